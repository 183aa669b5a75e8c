"""Remedies by gradient: which parameter buys most quiet, and the way there.

Two questions, two tools. `stabilise` asks for steady slip that is stable: a smooth function of the
blade, minimised from many starts at once. But loss of stability is subcritical: a blade whose
steady slip is stable may squeal all the same. `descend` therefore follows the noise itself, the
limit cycle, downhill until it ends. The cycle's derivatives are exact (implicit function theorem on
the return map); those of a simulated window are not worth much, since its cut through the last
period moves with the parameter, by an error that no longer window mends.

A gradient holds while the events keep their order. Each step that changes them is marked, and what
counts in the end is a simulation of the final blade from the default start (`verdict`).
"""

from .descent import Path as Path
from .descent import descend as descend
from .descent import verdict as verdict
from .gradient import MEASURES as MEASURES
from .gradient import sensitivities as sensitivities
from .steady import Stabilised as Stabilised
from .steady import stabilise as stabilise
