"""What a person writes: sweep and scene files, and one clear line when they are wrong.

Read `load`, `sweep`, `scene`, `system` (what both share), `tables` and `axis` (one table each),
`reversal`, `errors`. Imports no jax.
"""
