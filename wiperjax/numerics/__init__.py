"""Arithmetic without mechanics: what compiled loops over lanes are made of.

Read `runge_kutta` (steps of a solver's tableau), `bernstein` (polynomials of a step, their first
zeros), `quartic` (a step's polynomial through its nodes), `elementary` (functions that vectorise),
`known_zeros` (terms that are never computed), `sign_changes` (where a function has zeros),
`tracing` (what is traced once), `kept` (what later processes do not trace again), `rows` (trees of
numbers as tables), `fusion_barrier`, `arrays`, `types`.
"""
