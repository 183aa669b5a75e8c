"""Borders between the answers of a map, located by simulations that are spent on them.

Read `search` (what is looked at next, and why), `state` (what is known), `view` (what follows from
it), `judge` (which boxes are believed), `grid` (the virtual grid that numbers all points), `known`
(the points that are known), `cubes` (boxes between them), `surface` (the border inside a box),
`outcome` (what is found, and how far it can be believed), `step` (where an edge is looked at next),
`points` (some of them as a sweep), `bank` (answers that are there), `driver` (from file to file),
`replay` (a refined map asked). Plain numpy; jax comes in only with the blocks that are computed.
"""
