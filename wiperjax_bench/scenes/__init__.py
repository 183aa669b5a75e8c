"""What every method is measured on; knows no method.

Read `scene` (what a scene is), `families` (the scenes of the chart and of the speed table), `hard`
(those at which methods fail), `exact` (the one whose answer is known in closed form).
"""
