"""The ceiling of scalar code: one trajectory at a time, compiled by numba, written for speed.

The wiper of docs/model.md with a massless hinge, event-driven, adaptive Tsit5. What makes it fast:

- no arc sine and no power in a stage: the lean phi is integrated beside x (and set to asin(x / L)
  after every step), friction needs one exponential, the controller two square roots;
- stick is closed form: the cone is followed along x(t), nothing is integrated;
- a step is looked at for events only where end values and end slopes of a guard allow one; the
  root of its cubic is then stepped onto once, and one Newton correction puts the state on it;
- step sizes of slip and flight are remembered over events;
- stretches and their parts are compiled into the loop, so that records stay in registers;
- arithmetic may be reassociated and contracted (``fastmath``), NaN and infinity stay what they are.

Read `model`, `records`, `loop`, then the stretches `stick`, `slip`, `flight` and what ends them,
`change`; `tsit5`, `zeros` and `statistics` are their tools, `batch` runs many, `compiling` how.
"""
