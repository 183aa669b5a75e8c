"""Belts: at which speed steady sliding on them is sought."""

import numpy as np

from wiperjax import SteadyBelt, WipingBelt


def test_a_belt_made_of_one_of_the_package_is_judged_as_it_says():
    """At 0.3 m/s, its field, whatever it moved at then."""

    class Faster(SteadyBelt):
        def velocity(self, time, piece):
            return self.speed + time

        @property
        def judged_at(self):
            return 0.5

    class Early(WipingBelt):
        @property
        def judged_at(self):
            return 0.002

    assert Faster(0.3).judged_speed == 0.8
    np.testing.assert_allclose(Early(0.3, 10.0).judged_speed, 0.3 * np.sin(0.04 * np.pi))
    assert SteadyBelt(0.3).judged_speed == WipingBelt(0.3, 10.0).judged_speed == 0.3
