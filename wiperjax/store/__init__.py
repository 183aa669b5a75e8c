"""Maps on the disk, block by block, so that nothing is lost and nothing silently wrong.

Read `blocks` (the parts of an unfinished map), `manifest` (whose they are), `map_file` (parts into
one map), `spill`, `partial` (an unfinished map, read), `whole` (a finished one), `swept` (what it
was made from), `checksums` (its bytes compared) and `mending` (only what damage touched is computed
again). Imports no jax.
"""
