"""What is measured: each file is a command of `wiperjax bench`, or a part of one.

Read `errors` (what a right answer is), `chart` (error against cost; `confirm` says what its
reference is worth), `speed` with `fresh` (its start-ups in processes of their own) and `device`
(the engine on an accelerator), `sweep` (the command as users run it), `maps` (classes of a map),
`borders` (how far they are known), `failures` (the hard scenes), `stability_limits` with
`stability_theory`, `smoothing`, `profile` with `engine_parts`, `operations` and `processor`, and
`random_blades` with its `referee`.
"""
