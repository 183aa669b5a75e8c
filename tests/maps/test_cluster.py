"""Blocks as tasks of `dask.distributed`: the same map bit for bit, also when a worker is killed.

The workers are processes of their own. Most tests use a stub engine; the last one the real one.
"""

import contextlib
import gc
import os
import re
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import numpy as np
import processes
import pytest
import stub_sweep as stub
import xarray as xr
from slow_sweep import slow

from wiperjax.maps import block, cluster, driver, worker
from wiperjax.store.manifest import parts_of
from wiperjax.store.whole import open_map

pytestmark = [
    pytest.mark.slow,
    # of dask and of sockets that a killed worker leaves
    pytest.mark.filterwarnings("default"),
]


def interpreted(code, *given, **options):
    """What another interpreter makes of some code, with arguments."""
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), *given],
        **{"capture_output": True, "text": True, "env": processes.environment()} | options,
    )


@pytest.fixture(scope="module")
def workers():
    with cluster.connect(local=2) as found:
        yield found


def sweep(spec, path, workers, **options):
    with driver.sweep(
        spec,
        path,
        workers=workers,
        evaluate=slow,
        block=stub.BLOCK,
        progress=False,
        **options,
    ) as ds:
        return ds.load()


def pids(workers):
    return list(workers._client.run(os.getpid).values())


def test_a_cluster_makes_the_same_map(tmp_path, workers):
    spec, path = stub.make_spec(), tmp_path / "map.h5"
    ds = sweep(spec, path, workers)
    stub.assert_same_map(path, spec)
    assert ds.attrs["host"] and ds.attrs["wall_time"] >= 8 * 0.1
    in_memory = driver.sweep(spec, None, workers=workers, evaluate=slow, block=33, progress=False)
    xr.testing.assert_identical(stub.data_of(in_memory), stub.data_of(stub.whole(spec)))


@pytest.mark.long
def test_a_killed_worker_costs_a_retry(tmp_path, workers):
    spec, path = stub.make_spec(angles=28), tmp_path / "map.h5"
    before = pids(workers)
    killed, over = [], threading.Event()

    def kill():
        while len(killed) < 2 and not over.wait(0.35):
            with contextlib.suppress(OSError):  # the one that was killed may still be asked
                fresh = [pid for pid in pids(workers) if pid not in killed]
                os.kill(fresh[0], signal.SIGKILL)
                killed.append(fresh[0])

    thread = threading.Thread(target=kill)
    thread.start()
    sweep(spec, path, workers)
    over.set()
    thread.join()
    stub.assert_same_map(path, spec)
    assert killed and killed[0] in before  # two, unless the machine is very busy


@pytest.mark.long
def test_a_block_that_kills_its_workers_is_named_and_the_rest_is_kept(tmp_path):
    spec, path = stub.make_spec(), tmp_path / "map.h5"

    def deadly(spec, index, *look):
        if index[0] == 5 * stub.BLOCK:
            time.sleep(2)  # dask gives a worker up that dies while it starts
            os.kill(os.getpid(), signal.SIGKILL)
        return stub.evaluate(spec, index, *look)

    said = r"^block \d, or one that waited for the same worker, was lost with its worker 4 times"
    lost = pytest.raises(cluster.ClusterError, match=said)
    with cluster.connect(local=2) as own:  # that others do not share: it may have given one up
        with lost:
            driver.sweep(spec, path, workers=own, evaluate=deadly, block=stub.BLOCK, progress=False)
        assert len(stub.block_files(path)) >= 1
        sweep(spec, path, own, resume=True)
    stub.assert_same_map(path, spec)


def test_an_error_in_a_worker_is_the_error_of_the_sweep(tmp_path, workers):
    def wrong(spec, index):
        raise ValueError("wrong in a worker")

    with pytest.raises(ValueError, match="wrong in a worker"):
        driver.sweep(stub.make_spec(), tmp_path / "map.h5", workers=workers, evaluate=wrong)


def test_a_worker_of_another_version_is_refused(tmp_path, workers, monkeypatch):
    monkeypatch.setattr(block, "made_by", lambda spec: {"jax": "0.1"})
    with pytest.raises(cluster.ClusterError, match=r"a worker differs.*jax is [\d.]+, not 0.1"):
        sweep(stub.make_spec(), tmp_path / "map.h5", workers)
    assert not parts_of(tmp_path / "map.h5").exists()


def test_no_scheduler_is_one_line():
    import dask
    import distributed  # noqa: F401  its settings, which would go with the `with` below

    with dask.config.set({"distributed.comm.timeouts.connect": "200ms"}):
        with pytest.raises(cluster.ClusterError, match="^tcp://127.0.0.1:9: no scheduler answers"):
            with cluster.connect("tcp://127.0.0.1:9"):
                pass


@pytest.mark.parametrize("address", ["foo", "tcp://foo:", "nowhere://foo:1"])
def test_what_is_no_address_is_refused_at_once(address):
    """dask's client was made of it, and waited for itself for a minute when it was left."""
    begun = time.monotonic()
    said = f"scheduler must be an address such as tcp://HOST:PORT, but was '{address}'"
    with pytest.raises(cluster.ClusterError, match=f"^{re.escape(said)}$"):
        with cluster.connect(address):
            pass
    gc.collect()
    assert time.monotonic() - begun < 30


def claim(folder, **environment):
    """Process that claims an accelerator and holds it, and what it got or was told."""
    read, write = os.pipe()

    def work():
        os.environ.update(environment)
        try:
            said = str(worker.claim_accelerator(folder))
        except RuntimeError as error:
            said = str(error)
        os.write(write, said.encode())
        signal.pause()

    process = processes.fork(work)
    said = os.read(read, 1000).decode()
    os.close(read)
    os.close(write)
    return process, said


def end(process):
    os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)


def test_every_worker_takes_an_accelerator_of_its_own(tmp_path, monkeypatch):
    for name in ("nvidia0", "nvidia1", "nvidiactl", "null"):
        (tmp_path / name).touch()
    monkeypatch.setenv("SLURM_JOB_ID", f"test-{os.getpid()}")
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    held = [claim(tmp_path) for _ in range(3)]
    held += [claim(tmp_path, CUDA_VISIBLE_DEVICES=devices) for devices in ("1", "1,7")]
    said = [text for _, text in held]
    assert said[:2] == ["0", "1"] and "more workers than accelerators (2)" in said[2]
    assert said[3:] == ["None", "7"]
    end(held.pop(1)[0])
    held.append(claim(tmp_path))  # free again, once its holder has died
    assert held[-1][1] == "1"
    for process, _ in held:
        end(process)


@pytest.mark.long
def test_one_process_deals_a_block_to_all_its_accelerators():
    """Devices of the host stand in for them; what each would compute is only written down."""
    code = """
        import threading
        import jax, numpy as np
        from wiperjax.maps.cells import batch, devices
        from wiperjax.specs.load import parse_sweep

        class Enough(Exception):
            pass

        def note(wiper, position, velocity, count, *_):
            (device,) = position[0].devices()
            speeds = np.asarray(wiper.belt.speed)[: int(count)]
            seen.append((device.id, np.round(speeds, 3).tolist()))
            together.wait(60)  # the first to raise must not stop the others
            raise Enough

        seen, together = [], threading.Barrier(3)

        batch.compute, devices.devices = note, jax.devices
        axis = {"start": 0.1, "stop": 0.7, "num": 7}
        spec = parse_sweep({"axes": {"belt_speed": axis}, "run": {"transient": 0, "window": 1}})
        try:
            batch.evaluate(spec, np.arange(7))
        except Enough:
            print(sorted(seen))
    """
    flags = {"XLA_FLAGS": "--xla_force_host_platform_device_count=3", "JAX_PLATFORMS": "cpu"}
    ran = interpreted(code, env=processes.environment() | flags)
    assert ran.stdout.strip() == "[(0, [0.1, 0.4, 0.7]), (1, [0.2, 0.5]), (2, [0.3, 0.6])]", ran


SWEEP = """
[axes]
attack_angle = { start = -40, stop = 40, num = 14 }
belt_speed = { start = 0.1, stop = 1.0, num = 10, spacing = "geometric" }
[run]
transient = 0.01
window = 0.02
samples = 128
raster = 20
event_log = 12
"""


@pytest.mark.long
def test_the_real_engine_on_cores_and_on_a_cluster(tmp_path):
    """One core in one block (more cells than lanes), two cores in blocks of 90, two processes in
    blocks of 40: the same bits. The last two have lanes of one shape: with a cache they are
    compiled once.
    """
    cache = {"JAX_COMPILATION_CACHE_DIR": str(tmp_path / "cache")}
    calm = {"TF_CPP_MIN_LOG_LEVEL": "3"}  # XLA complains of compilations over two minutes
    (tmp_path / "s.toml").write_text(textwrap.dedent(SWEEP))
    ways = {
        "one": ["--workers", "1"],
        "two": ["--workers", "2", "--block", "90"],
        "cluster": ["--local-cluster", "2", "--block", "40"],
    }
    found = {}
    for name, options in ways.items():
        path = tmp_path / f"{name}.h5"
        words = ["sweep", tmp_path / "s.toml", "-o", path, "--no-picture", *options]
        ran = subprocess.run(
            [sys.executable, "-m", "wiperjax", *map(str, words)],
            capture_output=True,
            text=True,
            env=cache | processes.environment() | calm,
            cwd=Path(__file__).parent,
        )
        assert ran.returncode == 0, ran.stderr
        assert ran.stderr == ""
        with open_map(path) as ds:
            found[name] = stub.data_of(ds)
    assert found["one"].event_overflow.values.any() and not found["one"].event_overflow.values.all()
    assert found["one"].regime_raster.shape == (14, 10, 20)
    assert set(np.unique(found["one"].regime_raster)) <= {0, 1, 2, 3, 255}
    xr.testing.assert_identical(found["two"], found["one"])
    xr.testing.assert_identical(found["cluster"], found["one"])


def test_a_sweep_without_workers_stops_with_a_word():
    """dask itself would wait for one for ever."""

    def never(seconds):
        raise TimeoutError

    class Deserted:
        class _client:
            @staticmethod
            def nthreads():
                return {}

    with pytest.raises(cluster.ClusterError, match="^no worker was left for 0 s; finished blocks"):
        cluster.Workers._result(Deserted(), never, "a block", alone=0.0)  # type: ignore[arg-type]


def test_a_sweep_whose_local_workers_are_lost_before_its_first_task_stops_with_a_word(
    tmp_path, monkeypatch
):
    """A scheduler may have a queue of jobs; on this machine no other worker will come."""
    monkeypatch.setattr(cluster, "ALONE", 1)
    with cluster.connect(local=1) as workers:
        workers._client.retire_workers()
        with pytest.raises(cluster.ClusterError, match="^no worker was left for 1 s"):
            sweep(stub.make_spec(), tmp_path / "map.h5", workers)
    assert not parts_of(tmp_path / "map.h5").exists()


LOST = """
    import os, signal, subprocess, sys, threading, time
    from pathlib import Path
    from slow_sweep import slow
    from stub_sweep import BLOCK, block_files, make_spec
    from wiperjax.maps import cluster, driver

    folder = Path(sys.argv[1])
    file, path = folder / "scheduler.json", folder / "map.h5"
    words = ["--scheduler-file", str(file)]
    def start(*more):
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *more, *words], stderr=subprocess.DEVNULL, cwd=folder
        )
    scheduler = start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    worker = start("worker", "--nthreads", "1", "--no-nanny", "--no-dashboard")
    def kill():
        while len(block_files(path)) < 2:
            time.sleep(0.05)
        scheduler.kill()
    try:
        while not file.exists():
            time.sleep(0.05)
        import json
        with cluster.connect(json.loads(file.read_text())["address"]) as workers:
            threading.Thread(target=kill, daemon=True).start()
            driver.sweep(
                make_spec(angles=40), path, workers=workers, evaluate=slow, block=BLOCK,
                progress=False,
            )
    except cluster.ClusterError as error:
        print(error)
    finally:
        scheduler.kill()
        worker.kill()
"""


@pytest.mark.long
def test_a_lost_scheduler_is_one_line(tmp_path):
    ran = interpreted(LOST, tmp_path, timeout=200)
    said = r"the scheduler was lost \(\w+\); finished blocks are kept, give the same command again "
    said += r"\(a sweep with --resume\)\n"
    assert re.fullmatch(said, ran.stdout), ran
    assert ran.stderr == ""


@pytest.mark.long
def test_a_local_cluster_without_workers_is_one_line(monkeypatch):
    monkeypatch.setattr(cluster, "ALONE", 1)
    with pytest.raises(cluster.ClusterError, match="^no worker of this machine started within 1 s"):
        with cluster.connect(local=0):
            pass


PRESSED = """
    import os, signal, sys, threading
    from distributed.process import AsyncProcess
    from wiperjax.machine.interrupt import heeded
    from wiperjax.maps import cluster

    def press():
        os.killpg(0, signal.SIGINT)  # as a terminal does: every process of the command is told

    class Importing:
        def find_spec(self, name, path=None, target=None):
            if name == "distributed.comm.addressing":
                press()

    begin = AsyncProcess.start

    def starting(process):
        threading.Timer(0.7, press).start()  # a worker imports dask, or sleeps where it is quick
        return begin(process)

    signal.signal(signal.SIGINT, signal.default_int_handler)
    if sys.argv[1] == "importing":
        del sys.modules["distributed.comm.addressing"]
        sys.meta_path.insert(0, Importing())
    else:
        cluster._DEAF = "import time; time.sleep(1)\\n" + cluster._DEAF
        AsyncProcess.start = starting
    try:
        with heeded(), cluster.connect(local=1):
            print("connected")
    except KeyboardInterrupt:
        print("interrupted")
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="has no groups of processes")
@pytest.mark.parametrize("when", ["importing", "starting"])
def test_ctrl_c_while_a_local_cluster_begins_is_heard_without_tracebacks(when):
    """It was heard only once the first block was done, or in a hundred lines of dask's."""
    ran = interpreted(PRESSED, when, start_new_session=True, timeout=200)
    assert (ran.stdout, ran.stderr) == ("interrupted\n", "")
