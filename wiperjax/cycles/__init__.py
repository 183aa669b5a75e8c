"""Periodic motions, and branches of them.

Read `cycle` (a periodic motion with its multipliers), `find`, `return_map`, `roots`, `shooting`,
`chart`, `orbit`, `returns`, `first_guess`, `clock`, `drift`, `beginning`; then `walk`, by which
`branch` and `curve` are followed.
"""

from .branch.dataset import branch_dataset as branch_dataset
from .branch.follow import Branch as Branch
from .branch.follow import follow as follow
from .branch.up_and_down import up_and_down as up_and_down
from .curve.dataset import curves_dataset as curves_dataset
from .curve.follow import Curve as Curve
from .curve.follow import follow_curves as follow_curves
from .cycle import Cycle as Cycle
from .cycle import close as close
from .cycle import cycle_at as cycle_at
from .find import find_cycle as find_cycle
from .return_map import Found as Found
