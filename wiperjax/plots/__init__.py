"""Pictures of maps, runs and branches: a dataset in, matplotlib axes out; and of files by name.

Without `ax`, a function makes a page of its own, headed with the parameters; with it, it draws
there. Angles are degrees, positions millimetres. No jax here.
"""

from .animation import animate as animate
from .branches import bifurcation_diagram as bifurcation_diagram
from .branches import branch_overview as branch_overview
from .branches import branch_page as branch_page
from .branches import multipliers as multipliers
from .branches import remedy_bars as remedy_bars
from .catalogue import PICTURES as PICTURES
from .classes import class_map as class_map
from .classes import mechanism_map as mechanism_map
from .classes import motion as motion
from .classes import regime_map as regime_map
from .files import plot_all as plot_all
from .files import plot_file as plot_file
from .friction import friction_curve as friction_curve
from .history import time_history as time_history
from .line import along_axis as along_axis
from .line import regime_raster as regime_raster
from .overview import map_overview as map_overview
from .planes import fraction_map as fraction_map
from .planes import frequency_map as frequency_map
from .planes import value_map as value_map
from .portrait import phase_portrait as phase_portrait
from .run_page import history_page as history_page
from .run_page import run_overview as run_overview
from .spectra import spectrogram as spectrogram
from .spectra import spectrum as spectrum
