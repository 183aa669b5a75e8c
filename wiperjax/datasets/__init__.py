"""What is in a map, a run and a branch: datasets and what is read off them.

Read `map_dataset`, `borders`, `run_dataset`, `branch_dataset`; `kinds` says which a dataset is,
`run_fit`, `map_fit` and `stated` what of it another program has made impossible. No files here,
and no jax.
"""
