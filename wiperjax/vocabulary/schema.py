"""What a map stores for each cell: names, types, units, meanings.

A column that a caller offers beyond it is an error, one of it that is missing is left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .cf import flags, masks
from .codes import (
    BANDS,
    EVENTS,
    LABELS,
    MECHANISMS,
    NONE,
    NOT_COMPUTED,
    REGIMES,
    RESULTS,
    SETTLED,
    TOLD,
    VALIDITY,
)


@dataclass(frozen=True)
class Column:
    """One quantity stored for each cell: its name, numpy type, unit and meaning."""

    name: str
    dtype: str
    units: str
    long_name: str
    flags: Mapping[str, int] | None = None  # meaning -> code, for categories
    comment: str = ""
    along: str = ""  # the dimension it has beside those of the map, if any
    members: Mapping[str, int] | None = None  # meaning -> number of its bit, for sets of categories
    each_start: bool = True  # whether it has the dimension `start` too where cells have several

    def attributes(self) -> dict[str, Any]:
        """CF attributes of the variable; netCDF-valid types only."""
        attrs: dict[str, Any] = {"long_name": self.long_name}
        if self.flags is not None:
            attrs |= flags(self.flags, self.dtype)
        elif self.members is not None:
            attrs |= masks(self.members, self.dtype)
        elif self.units:
            attrs["units"] = self.units
        if self.comment:
            attrs["comment"] = self.comment
        return attrs

    @property
    def missing(self) -> Any:
        """Value of a cell that is not computed (yet)."""
        if np.dtype(self.dtype).kind == "u":
            return NONE
        return np.nan if np.dtype(self.dtype).kind == "f" else NOT_COMPUTED


_TABLE = (
    Column("label", "int8", "", "noise class", LABELS),
    Column("mechanism", "int8", "", "what keeps the motion going", MECHANISMS),
    Column("band", "int8", "", "band of the dominant frequency", BANDS),
    Column(
        "settled", "int8", "", "whether both halves of the window tell the same", SETTLED,
        comment="no: still growing or dying, or irregular; unknown: halves that do not compare",
    ),
    Column("result", "int8", "", "how the trajectory ended", RESULTS),
    Column("stick_fraction", "float64", "1", "share of the settled window in stick"),
    Column("slip_fraction", "float64", "1", "share of the settled window in slip"),
    Column("flight_fraction", "float64", "1", "share of the settled window in flight"),
    Column("stick_fraction_stroke", "float64", "1", "share of the strokes in stick"),
    Column("flight_fraction_stroke", "float64", "1", "share of the strokes in flight"),
    Column(
        "dominant_frequency", "float64", "Hz", "frequency of the strongest line of tip velocity",
        comment="Hann window, refined between bins; NaN where all samples are equal, or do not "
        "tell it; on a belt that reverses of the strokes, all alike, or of a tone around V = 0 if "
        "they are quiet",
    ),
    Column(
        "frequency_told", "int8", "", "whether the samples tell the frequency", TOLD,
        comment="no: something faster than the finest samples may be as strong; yes, NaN: no line",
    ),
    Column("velocity_rms", "float64", "m/s", "rms of the tip velocity about its mean"),
    Column(
        "velocity_rms_stroke", "float64", "m/s", "rms of the tip velocity away from reversal",
        comment="without what is slower than ten times the wiping frequency",
    ),
    Column("vibration_stroke", "float64", "m/s", "rms tip velocity of vibration away from reversal",
        comment="faster than the upper end of class_chatter_band",
    ),
    Column(
        *("vibration_reversal", "float64", "m/s", "rms tip velocity of vibration after reversal"),
    ),
    Column("tone_time_before", "float64", "s", "longest tone before V = 0",
        comment="faster than class_chatter_band, its level (rms over 5 ms) within 6 dB",
    ),
    Column("tone_time_after", "float64", "s", "longest tone after V = 0"),
    Column("tone_frequency_before", "float64", "Hz", "frequency of the longest tone before V = 0"),
    Column("tone_frequency_after", "float64", "Hz", "frequency of the longest tone after V = 0"),
    Column("reversal_count", "int32", "1", "passages of V through zero in the settled window"),
    Column("velocity_mean", "float64", "m/s", "mean tip velocity"),
    Column(
        "velocity_rms_reversal", "float64", "m/s",
        "root mean square of the tip velocity just after reversal",
    ),
    Column(
        "belt_speed_rms", "float64", "m/s", "root mean square of the belt speed", each_start=False
    ),
    Column(
        *("normal_force_mean", "float64", "N/m", "mean normal force"),
        comment="of contact that lasts: impulses of impacts are not in it",
    ),
    Column("normal_force_max", "float64", "N/m", "largest normal force"),
    Column("normal_force_mean_stroke", "float64", "N/m", "mean normal force away from reversal"),
    Column("normal_force_max_reversal", "float64", "N/m", "largest normal force around reversal"),
    Column("gap_max", "float64", "m", "largest gap between tip and glass"),
    Column("impact_count", "int32", "1", "impacts in the settled window"),
    Column("blow_count", "int32", "1", "blows against stops in the settled window"),
    Column("stick_count", "int32", "1", "stick phases begun in the settled window"),
    Column("lift_off_count", "int32", "1", "lift-offs in the settled window"),
    Column("slip_rate", "float64", "1/s", "slips out of stick per second"),
    Column(
        "force_drop", "float64", "N/m", "largest friction force in stick less the smallest in slip",
        comment="0 without stick or without slip; at the nodes of the steps",
    ),
    Column(
        "energy_per_slip", "float64", "J/m", "work done on friction, per slip out of stick",
        comment="0 where nothing sticks; what friction takes in impacts is not in it",
    ),
    Column(
        "acceleration_max", "float64", "m/s^2", "largest tip acceleration between impacts",
        comment="by the quartic through a step: up to half a per cent too small",
    ),
    Column("impact_impulse_max", "float64", "N s/m", "largest normal impulse of an impact"),
    Column("impact_impulse_reversal", "float64", "N s/m", "largest normal impulse around reversal"),
    Column(
        "growth_rate", "float64", "1/s", "growth rate of steady slip, linearised", each_start=False
    ),
    Column(
        "linear_frequency", "float64", "Hz", "frequency of steady slip, linearised",
        each_start=False,
    ),
    Column("steps", "int32", "1", "accepted steps"),
    Column("rejected_steps", "int32", "1", "rejected steps"),
    Column("unproved_steps", "int32", "1", "steps that might hide a double crossing"),
    Column("final_time", "float64", "s", "time reached"),
    Column("final_x", "float64", "m", "tip position along the glass at the end"),
    Column("final_y", "float64", "m", "gap at the end"),
    Column("final_vx", "float64", "m/s", "tip velocity along the glass at the end"),
    Column("final_vy", "float64", "m/s", "tip velocity normal to the glass at the end"),
    Column("final_position", "float64", "", "coordinates at the end",
        comment="of a system of one's own, each in its own unit", along="coordinate",
    ),
    Column("final_velocity", "float64", "", "velocities at the end",
        comment="rates of the coordinates", along="coordinate",
    ),
    Column("final_regime", "uint8", "", "regime at the end", REGIMES),
    Column(
        "class_set", "int16", "", "noise classes that the starts of the cell end in",
        members=LABELS, each_start=False,
    ),
    Column(
        "class_share", "float64", "1", "share of the random starts that end in the class",
        along="class", each_start=False,
    ),
    Column(
        "class_share_error", "float64", "1", "standard error of that share",
        comment="of (k + 2) of n + 4 starts (Agresti and Coull), so that it is not 0 where all "
        "starts seen agree", along="class", each_start=False,
    ),
    Column(
        "regime_raster", "uint8", "", "regime over time in the settled window", REGIMES,
        comment="none: the cell ended before", along="raster_time",
    ),
    Column(
        "event_count", "int32", "1", "events in the settled window",
        comment="all of them, also those that the log has no room for",
    ),
    Column(
        "event_overflow", "int8", "", "whether the cell had more events than its log has room for",
        {"no": 0, "yes": 1}, comment="yes: the log has the first ones only",
    ),
    Column(
        "event_time", "float64", "s", "time of the event since the start of the settled window",
        along="event",
    ),
    Column("event_kind", "uint8", "", "kind of event", EVENTS, along="event"),
    Column("regime_before", "uint8", "", "regime before the event", REGIMES, along="event"),
    Column("regime_after", "uint8", "", "regime after the event", REGIMES, along="event"),
    Column("event_impulse", "float64", "N s/m", "normal impulse of the event", along="event"),
)  # fmt: skip

EVENT_COLUMNS = {
    "time": "event_time",
    "kind": "event_kind",
    "before": "regime_before",
    "after": "regime_after",
    "impulse": "event_impulse",
}
"""Field of the engine's event log -> its column in maps and runs."""

ENDED = ("result", "final_x", "final_y", "final_vx", "final_vy", "final_regime")
"""Columns of a motion from which another can go on."""

ENDED_ELSEWHERE = ("result", "final_position", "final_velocity", "final_regime")
"""The same of a system of one's own."""


OF_THE_WINDOW = (
    *("reversal_count", "impact_count", "blow_count", "stick_count", "lift_off_count"),
    *("steps", "rejected_steps", "unproved_steps", "final_time"),
    *("final_x", "final_y", "final_vx", "final_vy", "final_regime", "settled"),
)
"""Columns of which one motion has another value in a longer window: counts, its end, and whether it
has settled."""

SEVERAL_STARTS = ("final_regime", "class_set", "class_share", "class_share_error")
"""Columns that only a map of several starts has; shares, only of random ones."""

_OF_DERIVATIVES = (
    Column("sensitivity_code", "int8", "", "whether the derivatives hold", VALIDITY,
        comment="not fine: the derivatives are NaN",
    ),
    Column("noise_period", "float64", "s", "period of the noise",
        comment="mean, by returns to the first event of the window; shares and means have the "
        "derivatives of whole periods; NaN: no returns, or uneven ones: those of the window",
    ),
    Column("grazing_margin", "float64", "1", "smallest depth or clearance of an event guard",
        comment="relative to the size of the guard; 0: an event just grazed",
    ),
    Column(
        "sensitivity_agreement", "float64", "1",
        "largest relative difference of a derivative from central differences",
        comment="NaN: not checked, or not fine",
    ),
)  # fmt: skip

OF_DERIVATIVES = tuple(column.name for column in _OF_DERIVATIVES)
"""Columns that only a map with derivatives has, beside these."""

OF_CELLS_ALONE = ("event_count", "event_overflow", *OF_DERIVATIVES)
"""Columns that the finer points of a refined map do not have."""

SCHEMA: Mapping[str, Column] = {column.name: column for column in (*_TABLE, *_OF_DERIVATIVES)}
"""Every column that has the same name in all maps; those of derivatives have the names of
parameters in theirs (`columns.sensitivity_name`)."""
