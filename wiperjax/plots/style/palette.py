"""Colours and marks of everything discrete, in one place: the same colour means the same in every
picture.

Classes are from the palette of Okabe and Ito, regimes from those of Tol: within each set all pairs
stay apart with protanopia, deuteranopia and tritanopia (tests/helpers/pictures.py measures it).
"""

UNKNOWN = "#999999"  # what has no name, and cells without a number
CLASSES = {
    "quiet": "#E3EAF0",
    "squeal": "#D55E00",
    "chattering": "#0072B2",
    "reversal": "#CC79A7",
    "other": "#F0C94A",
    "collapsed": "#FFFFFF",
    "failed": "#000000",
    "not_computed": "#BBBBBB",
}
HATCHES = {  # pattern and its colour
    "collapsed": ("////", "#666666"),
    "failed": ("xxxx", "#FFFFFF"),
    "not_computed": ("....", "#FFFFFF"),
    "several": ("\\\\\\\\", "#333333"),  # where the class hangs on the start
}
MECHANISMS = {  # what keeps a motion going, as `noise.classes` tells it
    "quiet": CLASSES["quiet"],
    "self_excited_slip": "#E69F00",
    "stick_slip": "#332288",
    "flight": "#56B4E9",
    "carried": "#AA4499",
    "reversal_pulse": CLASSES["reversal"],
    "reversal_impulse": "#882255",
    "vibro_impact": "#117733",
}
BANDS = {  # where the frequency of a noise lies
    "quiet": CLASSES["quiet"],
    "none": UNKNOWN,
    "chatter": CLASSES["chattering"],
    "low": "#DDCC77",
    "squeal": CLASSES["squeal"],
    "high": "#882255",
}
REGIMES = {
    "stick": "#332288",
    "slip_pos": "#E69F00",
    "slip_neg": "#A63603",
    "flight": "#56B4E9",
}
MOTIONS = {  # what a settled motion consists of; named after the rarest regime in it
    "steady_slip": "#FBEBCF",
    "slip_only": REGIMES["slip_pos"],
    "stick_and_slip": REGIMES["stick"],
    "stick_slip_and_flight": REGIMES["flight"],
    "slip_and_flight": "#117733",
    "stick_only": "#AA4499",
    "collapsed": CLASSES["collapsed"],
    "failed": CLASSES["failed"],
    "not_computed": CLASSES["not_computed"],
}
SPARE = (  # of categories that have no colours of their own; first what is farthest from classes
    *("#882255", "#332288", "#88CCEE", "#CC6677", "#117733", "#999933", "#DDCC77", "#44AA99"),
)
NAMES = {
    "slip_pos": "slip forward",
    "slip_neg": "slip backward",
    "stick_slip": "stick-slip",
    "self_excited_slip": "self-excited slip",
    "vibro_impact": "vibro-impact",
    "stick_slip_and_flight": "stick, slip and flight",
}
BOUNDARY = "#000000"  # line at which steady slip loses its stability
BORDER = "#FFFFFF"  # located border between the classes of a refined map
HALO = "#FFFFFF"  # around curves, so that they are seen on every colour
CURVES = {  # curves in two parameters: colour and line
    "hopf": ("#882255", "-"),
    "fold": ("#0072B2", "-"),
    "grazing_sliding_fold": ("#0072B2", "--"),
}
BELT = "#009E73"  # velocity of the glass
EVENTS = {  # marker of an event, in the order of rows from the top
    "belt_reversal": "D",
    "impact": "v",
    "zeno": "*",
    "blow": "s",
    "lift_off": "^",
    "capture": "|",
    "release": "|",
    "reversal": "|",
}
EVENT_NAMES = {
    "belt_reversal": "belt reversal",
    "impact": "impact",
    "zeno": "impacts to rest",
    "blow": "blow against a stop",
    "lift_off": "lift-off",
    "capture": "slip to stick",
    "release": "stick to slip",
    "reversal": "slip reversal",
}


def readable(name: str) -> str:
    """Name of a class or regime as it stands in a legend."""
    return NAMES.get(name, name.replace("_", " "))
