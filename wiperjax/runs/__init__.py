"""One trajectory for a person: started, watched, labelled.

Read `simulate`, `dataset` (its result), `scene` (from a file).
"""
