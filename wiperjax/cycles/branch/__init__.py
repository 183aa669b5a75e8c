"""Branches of cycles over a parameter, and what happens on them.

Read `follow`, `step`, `walk`, `bifurcations`, `dataset`, `from_scene`, `up_and_down`, `repeats`,
`peaks`.
"""
