"""What every method is measured on; knows no method.

Read `scene` (what a scene is), `families` (the scenes of the chart and of the speed table), `hard`
(those at which methods fail, made by `hard_contact` and `hard_sliding` of `four` blades each),
`wide` (blades drawn over decades), `exact` (the one whose answer is known in closed form).
"""
