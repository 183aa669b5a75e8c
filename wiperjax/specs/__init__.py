"""What a person writes: sweep and scene files, and one clear line when they are wrong.

Read `load`, `sweep`, `scene`, `system` (what both share), `tables` and `axis` (one table each),
`windows` (what a stretch of time shows), `errors`. Imports no jax.
"""
