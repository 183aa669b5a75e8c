"""Borders between the answers of a map, located by simulations that are spent on them.

Read `search` (what is looked at next, and why), `state` (what is known, and what follows), `grid`
(the virtual grid that numbers all points), `known` (the points that are known), `cubes` (boxes
between them), `surface` (the border inside a box), `step` (where an edge is looked at next),
`points` (some of them as a sweep), `bank` (answers that are there), `driver` (from file to file),
`replay` (a refined map asked). Plain numpy; jax comes in only with the blocks that are computed.
"""
