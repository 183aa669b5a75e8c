"""What is gathered along a trajectory: integrals, extremes, counts.

Read `base` (what an observer is), `totals` (times and integrals of each regime), `reversal` (force
about the reversals of the belt), `returns` (totals of whole periods), `margins` (how near the
motion came to other events), `told` (their records by the names of columns).
"""
