"""This process, this computer, whole files. Knows no mechanics and no jax.

Read `files` (a file is written at once or not at all), `paths` (what a path leads to), `lock`,
`jax_settings` (what must be set before JAX starts), `compiled` (programs kept for the next
process), `cores`, `memory`, `interrupt` (Ctrl-C), `phases` (where the time goes), `provenance`
(what made a file).
"""
