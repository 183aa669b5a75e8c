"""Blocks in a row, the first of them on a belt."""

from own_systems import Falling
from systems import FirstOnBelt

import wiperjax


class Row(FirstOnBelt):
    """A block on a spring of stiffness 1 and on a belt; a second one, of mass 2, linked to it by a
    spring and a dashpot of 0.2. `damping`: of a dashpot beside the first spring.
    """

    belt: float = 0.2
    link: float = 1.0
    damping: float = 0.0
    friction: wiperjax.AbstractFriction = Falling()

    def free_acceleration(self, t, q, v):
        pull = self.link * (q[1] - q[0]) + 0.2 * (v[1] - v[0])
        return pull - q[0] - self.damping * v[0], -pull / 2.0

    def default_state(self):
        return (0.0, 0.0), (0.0, 0.0)
