"""A map: blocks of cells computed, stored and put together.

Read `driver` (a sweep from file to file), `block` (some cells computed and named), `cells` (the
computation, all that names jax), `refine` (borders of a finished map), `cluster`, `progress`,
`estimate`, `verify`, `accuracy`, `compare_rungs` (the poorest model that still tells a scene).
"""
