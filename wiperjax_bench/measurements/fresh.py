"""What only a process of its own can tell.

``python -m wiperjax_bench.measurements.fresh compile|memory`` prints it as JSON.
"""

import json
import sys
import time


def compile_() -> dict[str, float]:
    """Return seconds from the start of the first block of a small sweep to its end, and again."""
    from wiperjax.machine.jax_settings import configure

    configure(1, keep=False)
    import numpy as np

    from wiperjax.maps.cells import batch
    from wiperjax.specs.load import parse_sweep

    spec = parse_sweep(
        {
            "axes": {
                "attack_angle": {"start": -30, "stop": 30, "num": 8},
                "normal_load": {"start": 10, "stop": 20, "num": 4},
                "belt_speed": {"start": 0.1, "stop": 1, "num": 4},
            },
            "run": {"transient": 1e-4, "window": 1e-3},
        },
        "bench",
    )
    times = []
    for _ in range(2):
        started = time.perf_counter()
        batch.evaluate(spec, np.arange(128))
        times.append(time.perf_counter() - started)
    return {"compile": times[0], "block": times[1]}


def memory() -> dict[str, float]:
    """Return the largest resident memory of a batch of a million very short trajectories."""
    from wiperjax.machine.jax_settings import configure

    configure(1, keep=False)
    import diffrax

    from wiperjax.machine.memory import peak_memory

    from ..rivals.engine import Engine
    from ..scenes.families import workload

    Engine(diffrax.Tsit5).prepare(workload(1_000_000, 1e-5), 1e-6)()
    return {"memory_gib": peak_memory() / 2**30}


if __name__ == "__main__":
    print(json.dumps({"compile": compile_, "memory": memory}[sys.argv[1]]()))
