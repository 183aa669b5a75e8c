"""A trajectory at equal intervals, whatever its steps.

Read `at_times` (states at instants), `means` (velocity averaged over each interval).
"""
