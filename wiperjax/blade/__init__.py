"""The wiper and its poorer models: systems that the engine runs.

Read `wiper` (the lip), `bar` and `block` (models of one coordinate), `rungs` (one ladder of them),
`steady_slip` (equilibria and their stability), `build` (from the parameters of a cell).
"""
