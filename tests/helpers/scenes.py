"""The scenes, what removes their noise, and further cells that claims rest on.

Remedies are those of `sweeps/remedies/`: the first cell of each file is its scene. All cells of one
kind of belt are computed together.
"""

import numpy as np
from noises import Cases, changed, parameters, remedies

# scene -> (class, mechanism, band, frequency [Hz] and its tolerance)
STEADY = {
    "squeal": ("squeal", "stick_slip", "squeal", 780.8, 0.5),
    "squeal_slip": ("squeal", "self_excited_slip", "squeal", 680.4, 2.0),
    "chatter": ("chattering", "stick_slip", "chatter", 39.7, 0.3),
    "chatter_flight": ("chattering", "flight", "chatter", 28.2, 0.5),
    "quiet": ("quiet", "none", "none", None, None),
    "quiet_wet": ("quiet", "none", "none", None, None),
}


TRAPEZOID = {
    "reversal": ("reversal", "reversal_pulse", "none", None, None),
    "reversal_impulse": ("reversal", "reversal_impulse", "none", None, None),
}


WIPING = {
    # its tone glides from 800 to 910 Hz and grows out of rounding errors: the highest line is one
    # of these, on one processor (512 bits) 836 and on another (the same vectors) 898 Hz
    "squeal_reversal": ("squeal", "stick_slip", "squeal", 855.0, 55.0),
    "reversal_sine": ("reversal", "reversal_pulse", "none", None, None),
}


REMEDIES = {
    "squeal": (("support_damping", 9), ("mu_static", 0.36)),
    "squeal_slip": (("support_damping", 8), ("mu_static", 0.56)),
    "squeal_reversal": (("support_damping", 20), ("mu_static", 0.32)),
    "chatter": (("support_damping", 3), ("mu_static", 0.6)),
    "chatter_flight": (("support_damping", 6.5), ("belt_speed", 0.325)),
    "reversal": (("support_stiffness", 6000), ("lip_length", 3e-3)),
    "reversal_impulse": (("support_stiffness", 6000), ("shoulder_angle", 18)),
    "reversal_sine": (("support_stiffness", 6000), ("lip_length", 3e-3)),
}


OTHERS = {  # further cells that a claim rests on
    "chatter mirrored": ("chatter", {"attack_angle": 30}),
    "chatter_flight mirrored": ("chatter_flight", {"attack_angle": 35}),
    "chatter weak remedy": ("chatter", {"support_damping": 2}),
    "squeal_slip less damping": ("squeal_slip", {"support_damping": 3}),
    "reversal damped": ("reversal", {"support_damping": 20}),
    "squeal_reversal half a remedy": ("squeal_reversal", {"support_damping": 6}),
    # the tip vibrates above half the sampling rate of the first look
    "squeal steep": ("squeal", {"attack_angle": 40, "normal_load": 20, "belt_speed": 0.2091}),
    "squeal steeper": ("squeal", {"attack_angle": 40, "normal_load": 25, "belt_speed": 0.2091}),
    # a train of pulses whose eleventh line is the highest by a hair
    "chatter rare": ("chatter", {"attack_angle": -40, "normal_load": 5, "belt_speed": 0.0437}),
    "reversal_sine undamped": ("reversal_sine", {"support_damping": 1, "lip_length": 3e-3}),
}


def one_less(name, parameter, value):
    """The value of the map's axis before `value`."""
    values = remedies(name).axes_values()[parameter]
    return float(values[np.argmin(np.abs(values - value)) - 1])


def evaluated(scenes, run_of, **changes):
    """Cells of `scenes`, their remedies and the other cases, keyed by name; run as the sweep
    `run_of`, but for `changes` of its `[run]`."""
    cases = {}
    for name in scenes:
        cases[name] = parameters(name)
        for parameter, value in REMEDIES.get(name, ()):
            cases[f"{name}: {parameter}"] = changed(cases[name], **{parameter: value})
            less = {parameter: one_less(name, parameter, value)}
            cases[f"{name}: {parameter}, one less"] = changed(cases[name], **less)
    for name, (scene, values) in OTHERS.items():
        if scene in scenes:
            cases[name] = changed(parameters(scene), **values)
    like = remedies(run_of)
    like = like.model_copy(update={"run": like.run.model_copy(update=changes)})
    return Cases(like, cases).evaluate()
