"""What one core of this processor can do, measured: operations, and bytes from its caches."""

import time

import jax
import jax.numpy as jnp
from jax import lax


def least_time(call, repeats: int = 5) -> float:
    """Return the least processor time of a call [s], after one to compile."""
    call()
    costs = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        costs.append(time.process_time() - start)
    return min(costs)


def peak(precision: str) -> float:
    """Return measured flop/s of one core on fused multiply-adds: the best of several loops.

    They differ in how many follow each other on a number, and over how many numbers: too few wait
    for memory, too many for each other.
    """

    def speed(n: int, chain: int) -> float:
        turns = int(1e8 / n / chain)

        @jax.jit
        def loop(x, a, b):
            def body(_, x):
                for _ in range(chain):
                    x = x * a + b
                return x

            return lax.fori_loop(0, turns, body, x)

        given = jnp.ones(n, precision), jnp.asarray(0.999, precision), jnp.asarray(1e-3, precision)
        seconds = least_time(lambda: jax.block_until_ready(loop(*given)), 3)
        return 2 * n * chain * turns / seconds

    return max(speed(n, chain) for n in (1024, 4096) for chain in (8, 16, 32))


def bandwidth(size: int) -> float:
    """Return measured bytes/s of one core that adds two float64 arrays of ``size`` bytes."""
    n = size // 8

    @jax.jit
    def loop(x, y):
        return lax.fori_loop(0, turns, lambda _, p: (p[1], p[0] + p[1]), (x, y))

    turns = max(20, int(2e9 / size))
    x, y = jnp.full(n, 1e-9), jnp.full(n, 1e-9)
    return 3 * size * turns / least_time(lambda: jax.block_until_ready(loop(x, y)))
