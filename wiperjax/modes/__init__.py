"""Complex eigenvalues of steady sliding, of any system: what grows, how fast, in which shape.

Read `linear` (equilibrium and linearisation), `table` (modes of one system), `over` (modes over the
parameters of a sweep, and what its map says of them).
"""
