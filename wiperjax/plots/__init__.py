"""Pictures of maps, runs and branches: a dataset in, matplotlib axes out; and of files by name.

Without `ax`, a function makes a page of its own, headed with the parameters; with it, it draws
there. Angles are degrees, positions millimetres. No jax here.

Raises `ValueError`, one line, for a dataset of another kind or an option that cannot be meant.
"""

from . import branches, curves, modes
from .catalogue import PICTURES as PICTURES
from .door import of
from .files import plot_all as plot_all
from .files import plot_file as plot_file
from .maps import borders, classes, line, overview, planes
from .runs import animation, friction, history, page, portrait, spectra

_MOTION = ("time", "position", "velocity", "regime")
_FORCES = ("normal_force", "friction_force")
_SHARES = ("label", "stick_fraction", "flight_fraction", "velocity_rms")

# maps
with_borders = of("map", "label")(borders.with_borders)
with_curves = of("map", "label")(curves.with_curves)
class_map = of("map", "label")(classes.class_map)
mechanism_map = of("map", "label", "mechanism")(classes.mechanism_map)
motion = of("map", *_SHARES)(classes.motion)
regime_map = of("map", *_SHARES)(classes.regime_map)
value_map = of("map", "label")(planes.value_map)
fraction_map = of("map", "label")(planes.fraction_map)
frequency_map = of("map", "label", "dominant_frequency")(planes.frequency_map)
map_overview = of("map", *_SHARES, "dominant_frequency")(overview.map_overview)
along_axis = of("map", *_SHARES, "dominant_frequency", "slip_fraction")(line.along_axis)
class_shares = of("map", "label")(line.class_shares)
regime_raster = of("map", "label")(line.regime_raster)

# runs
time_history = of("run", *_MOTION)(history.time_history)
history_page = of("run", *_MOTION)(page.history_page)
phase_portrait = of("run", *_MOTION)(portrait.phase_portrait)
friction_curve = of("run", *_MOTION, *_FORCES, "slip_speed")(friction.friction_curve)
spectrum = of("run", "time")(spectra.spectrum)
spectrogram = of("run", "time", "regime")(spectra.spectrogram)
run_overview = of("run", *_MOTION)(page.run_overview)
animate = of("run", *_MOTION, *_FORCES)(animation.animate)

# branches of cycles, and remedies
bifurcation_diagram = of("branch", "stable", "maximum")(branches.bifurcation_diagram)
_CYCLES = ("stable", "maximum", "amplitude", "velocity_rms")
branch_page = of("branch", *_CYCLES)(branches.branch_page)
branch_overview = of("branch", *_CYCLES, "period")(branches.branch_overview)
multipliers = of("branch", "multiplier_real", "multiplier_imag")(branches.multipliers)
modes_page = of("modes_over", "growth_rate", "real_part", "frequency")(modes.modes_page)
curve_page = of("branch", "curve_row_size")(curves.curve_page)
remedy_bars = of("remedies", "buys", "parameter")(branches.remedy_bars)
