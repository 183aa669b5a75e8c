"""The first event of a tried step: where it is, and what it does.

Read `plan` (what of the step is kept), `first_zero`, `arrival` (with what error an event time is
found), `event_time` (its derivative), `transition` (the state after it), `stop`
(velocities behind a blow against one).
"""
