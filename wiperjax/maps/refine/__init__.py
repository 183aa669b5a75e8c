"""Borders between the answers of a map, located by simulations that are spent on them.

Read `search` (what is looked at next, and why), `grid` (the virtual grid that numbers all points),
`known` (the points that are known), `cubes` (boxes between them), `surface` (the border inside a
box), `step` (where an edge is looked at next), `points` (some of them as a sweep), `driver` (from
file to file). Plain numpy; jax comes in only with the blocks that `driver` computes.
"""
