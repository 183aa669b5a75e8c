"""Random blades on steady belts."""

import jax
import numpy as np

PARAMETERS = ("attack_angle", "normal_load", "restitution", "mu_static", "support_stiffness")


def draw(count, seed=3):
    rng = np.random.default_rng(seed)
    values = dict(
        attack_angle=rng.uniform(-0.7, 0.7, count),
        normal_load=rng.uniform(5, 30, count),
        restitution=rng.uniform(0, 0.9, count),
        mu_static=rng.uniform(0.4, 1.4, count),
        support_stiffness=rng.uniform(1000, 8000, count),
    )
    return values, rng.uniform(0.05, 1, count)


def lane(tree, i):
    return jax.tree.map(lambda x: x[i], tree)
