"""What a motion is called: its frequency, its tones, its class.

Read `spectrum`, `between_bins` (its lines to a part of a bin), `tones`, `signals` (of a block of
cells), `classes`, `class_counts`, `run_class` (of one run), `agreement` (of two models). Imports no
jax.
"""
