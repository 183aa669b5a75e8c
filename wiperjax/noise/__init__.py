"""What a motion is called: its frequency, its tones, its class.

Read `spectrum`, `tones`, `signals` (of a block of cells), `classes`, `class_counts`, `run_class`
(of one run). Imports no jax.
"""
