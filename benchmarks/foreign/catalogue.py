# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The catalogue of hidden changes: their shares, sizes, units, drivers, and what counts as a right answer."""

from __future__ import annotations

from dataclasses import dataclass

SIZES = ("small", "medium", "large")
GROUP_SHARES = {
    "none": 0.30,
    "input_shift": 0.05,
    "wrench": 0.08,
    "measurement": 0.10,
    "variance": 0.05,
    "library": 0.336,
    "outside": 0.084,
}
CHANNELS = {
    "none": "none",
    "input_shift": "none",
    "wrench": "wrench",
    "measurement": "measurement",
    "variance": "variance",
    "library": "motion",
    "outside": "motion",
}
TWO_EFFECTS = 0.2  # share of the recordings with an effect on motion that have two of them
SESSION = ("session", "model_inputs")
WORLD = ("session", "push_heading", "slider_heading")
BODY = ("session", "edge", "model_inputs")
TEMPERATURE = "topic:/surface/temperature"


@dataclass(frozen=True)
class ChangeKind:
    """One kind of change: its group, sizes (small, medium, large), possible drivers, and the right answers.

    `scale` names what the sizes are multiplied by: nothing, the friction force or the friction torque. `names` and
    `constant_covariates` are right for the effect when it does not depend on anything recorded.
    """

    group: str
    sizes: tuple[float, float, float]
    unit: str
    drivers: tuple[str, ...]
    constant_covariates: tuple[str, ...]
    names: tuple[str | None, ...]
    signed: bool = False
    scale: str = ""
    constant_form: str = "constant"


_DRIFTS = ("push_index", "elapsed_time", "slid_distance", "elapsed_time")
_COMMON = ("constant",) * 6 + ("step",) * 3 + _DRIFTS + ("temperature",) * 3 + ("place",) * 3
_ANY = (*_COMMON, "heading", "heading", "edge", "edge", "speed", "speed")
_LATER = ("constant", "constant", "step", "elapsed_time")


def _named(
    name: str, sizes: tuple[float, float, float], unit: str, drivers: tuple[str, ...], constant: tuple[str, ...]
) -> ChangeKind:
    """A change that the library of mechanisms knows."""
    signed = name in ("contact_friction", "pressure_spread")
    return ChangeKind("library", sizes, unit, drivers, constant, (name,), signed=signed)


def _unnamed(
    sizes: tuple[float, float, float],
    unit: str,
    drivers: tuple[str, ...],
    constant: tuple[str, ...],
    form: str = "constant",
    scale: str = "",
) -> ChangeKind:
    """A change that no mechanism of the library describes."""
    return ChangeKind("outside", sizes, unit, drivers, constant, (None,), scale=scale, constant_form=form)


def _fault(name: str, sizes: tuple[float, float, float], unit: str, covariates: tuple[str, ...]) -> ChangeKind:
    """A fault of measurement. With a tip that never turns, tool offset and frame shift look the same."""
    twins = ("frame_shift", "tool_offset")
    names = (name, *(twin for twin in twins if twin != name)) if name in twins else (name,)
    drivers = ("constant", "constant", "constant", "step")
    return ChangeKind("measurement", sizes, unit, drivers, covariates, names)


CHANGE_KINDS: dict[str, ChangeKind] = {
    "contact_friction": _named("contact_friction", (0.1, 0.2, 0.4), "1", _ANY, SESSION),
    "pressure_spread": _named("pressure_spread", (0.06, 0.12, 0.2), "of the load's rms radius", _ANY, SESSION),
    "centre_of_friction": _named("centre_of_friction", (0.005, 0.01, 0.02), "m", _ANY, BODY),
    "anisotropic_friction": _named("anisotropic_friction", (0.2, 0.4, 0.7), "of the mean", _COMMON, WORLD),
    "body_anisotropy": _named("body_anisotropy", (0.2, 0.4, 0.7), "of the mean", (*_COMMON, "speed", "speed"), BODY),
    "tilted_surface": _named("tilted_surface", (0.02, 0.05, 0.1), "of the weight", _COMMON, WORLD),
    "surface_friction": ChangeKind(
        "wrench",
        (0.1, 0.2, 0.4),
        "of its value",
        ("constant", "constant", "constant", "step", "elapsed_time", "temperature"),
        SESSION,
        ("surface_friction",),
        signed=True,
    ),
    "clock_offset": _fault("clock_offset", (0.005, 0.015, 0.04), "s", SESSION),
    "frame_rotation": _fault("frame_rotation", (0.01, 0.03, 0.08), "rad", (*WORLD, "slider_x", "slider_y")),
    "frame_shift": _fault("frame_shift", (0.0003, 0.001, 0.0025), "m", WORLD),
    "tool_offset": _fault("tool_offset", (0.0003, 0.001, 0.0025), "m", WORLD),
    "wrench_bias": _fault("wrench_bias", (0.1, 0.2, 0.5), "N", WORLD),
    "noise": ChangeKind("variance", (1.2, 1.5, 2.0), "ratio", ("constant",), SESSION, ()),
    "cable": _unnamed((0.15, 0.3, 0.5), "N", _LATER, (*WORLD, "slider_x", "slider_y"), form="constant", scale="force"),
    "magnet": _unnamed((0.2, 0.4, 0.7), "N", ("constant",), ("slider_x", "slider_y", "session"), "map", "force"),
    "rubber_band": _unnamed(
        (0.1, 0.2, 0.4), "N m", ("constant", "step"), ("slider_heading", "session"), "periodic", "torque"
    ),
    "skewed_friction": _unnamed((0.1, 0.2, 0.4), "rad", (*_LATER, "place", "temperature"), SESSION),
    "soft_tip": _unnamed((0.001, 0.002, 0.003), "m/N", (*_LATER, "temperature"), SESSION),
    "worn_edge": _unnamed((0.15, 0.3, 0.5), "rad", ("constant", "step"), ("contact", *BODY), "map"),
    "sticky_base": _unnamed((0.3, 0.6, 1.2), "of the friction", ("rest",), ("dwell_time", "time_since_contact")),
    "grease": _unnamed(
        (0.15, 0.3, 0.6),
        "of the friction at 20 mm/s",
        ("constant", "step", "temperature"),
        ("velocity", *BODY),
        "linear",
    ),
}
