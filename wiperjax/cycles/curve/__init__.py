"""Curves in the plane of two parameters: where steady slip loses its stability, where cycles end.

Read `plane`, `equations`, `walk`; the kinds `hopf`, and on `of_cycles` `fold` and `touch`; then
`follow`, `dataset`.
"""
