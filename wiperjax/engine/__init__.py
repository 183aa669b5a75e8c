"""The event loop over solver steps, and what it gathers. Knows no wipers.

Read `solve` (one trajectory, or a batch of fixed cells), `step` (one turn of the loop: flow, then
jump), `lanes` (many cells on few lanes). A turn of the loop is `carry` (what it hands on), `trial`
(a step is tried), `event` (the first event in it is placed and what it does), `sampling` and
`observers` (what is kept). `reverse` runs it backwards for gradients; `arguments` checks
what a person gives.
"""
