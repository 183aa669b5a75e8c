"""A map: blocks of cells computed, stored and put together.

Read `driver` (a sweep from file to file), `computing` (who computes its blocks), `block` (some
cells computed and named), `starts` (each from several), `cells` (the computation), `basins` (which
motion each start of one system ends in; these two are all that names jax), `refine` (borders of a
finished map), `cluster` and `worker` (its processes), `progress`, `estimate`, `verify`, `accuracy`,
`compare_rungs` (the poorest model that still tells a scene) and `around_scene` (the cells beside
it), `auto_model` (the poorest that tells a map).
"""
