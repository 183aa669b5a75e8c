"""A step is tried: solved, its error measured, its guards proved free of zeros.

Read `attempt`, `step_control`, `guard_proof`.
"""
