"""One frictional contact at one instant: no time, no wiper.

Read `system` (what a mechanical system must say), `fits` (whether it does), `joints` (whether its
prescribed motion goes on from piece to piece), `own_numbers` (which of its fields are numbers),
`on_belt` (one whose partner is a belt), `card` (one as a notebook shows it), `space` (its contact
space), `friction`, `belts` (the partner's motion), `regimes` (forces, and which regime holds),
`guards` (what ends a regime), `impact`, `projection`, `zeno`, `jam`.
"""
