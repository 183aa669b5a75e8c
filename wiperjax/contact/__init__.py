"""One frictional contact at one instant: no time, no wiper.

Read `system` (what a mechanical system must say), `space` (its contact space), `friction`,
`regimes` (forces, and which regime holds), `guards` (what ends a regime), `impact`, `projection`,
`zeno`, `jam`.
"""
