"""Remedies by gradient: which parameter buys most quiet, and the way there.

Three questions, three tools. `stabilise` asks for steady slip that is stable, the smallest change
that makes it so; no motion is simulated. But loss of stability is subcritical: a blade whose
steady slip is stable may squeal all the same. `quieten` minimises the simulated noise itself, from
many starts at once; its derivatives are those of a window, whose cut through the last period moves
with the parameter: good enough to search with. `descend` follows the limit cycle downhill until it
ends; its derivatives are exact (implicit function theorem on the return map).

A gradient holds while the events keep their order. Each step that changes them is marked, and what
counts in the end is a simulation of the final blade from the default start (`verdict`).
"""

from .descent import Path as Path
from .descent import descend as descend
from .gradient import MEASURES as MEASURES
from .gradient import sensitivities as sensitivities
from .judge import verdict as verdict
from .quiet import Quietened as Quietened
from .quiet import quieten as quieten
from .steady import Stabilised as Stabilised
from .steady import stabilise as stabilise
