# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of the forward model: one table of names, units, textbook values, plausible ranges and priors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from push_predictor.types import Array

# Values by name: a number, or one per push (n,). A name that is missing has its textbook value.
ParameterValues: TypeAlias = Mapping[str, "float | Array"]


@dataclass(frozen=True)
class MechanicsParameter:
    """A number of the forward model.

    textbook: value without further knowledge. low, high: plausible range of a rig. spread: standard deviation of the
    weak prior about the textbook value. part: contact, pressure, measurement or world. needs: covariates that it needs.
    """

    name: str
    unit: str
    textbook: float
    low: float
    high: float
    spread: float
    part: str
    meaning: str
    needs: tuple[str, ...] = ()


_HEADING = ("push_heading",)

PARAMETERS: tuple[MechanicsParameter, ...] = (
    MechanicsParameter(
        "contact_friction", "1", 0.3, 0.0, 1.5, 0.15, "contact", "coefficient of friction between pusher and slider"
    ),
    MechanicsParameter(
        "friction_difference", "1", 0.0, -0.6, 0.6, 0.1, "contact", "contact friction in left slip minus the mean"
    ),
    MechanicsParameter(
        "friction_by_angle", "1/rad", 0.0, -0.5, 0.5, 0.15, "contact", "change of contact friction with the push angle"
    ),
    MechanicsParameter(
        "friction_by_speed", "1", 0.0, -0.2, 0.2, 0.05, "contact", "contact friction per e-fold of tangential speed"
    ),
    MechanicsParameter(
        "friction_by_load", "1", 0.0, -0.5, 0.5, 0.1, "contact", "contact friction per e-fold of normal force"
    ),
    MechanicsParameter(
        "rim_exponent", "1", 0.0, -4.0, 12.0, 1.5, "pressure", "exponent of the pressure's growth towards the rim"
    ),
    MechanicsParameter(
        "pressure_spread", "1", 0.0, -1.5, 1.0, 0.1, "pressure", "logarithm of a factor on the pressure's spread"
    ),
    MechanicsParameter(
        "centre_x", "m", 0.0, -0.03, 0.03, 0.004, "pressure", "shift of the centre of pressure along the slider's x"
    ),
    MechanicsParameter(
        "centre_y", "m", 0.0, -0.03, 0.03, 0.004, "pressure", "shift of the centre of pressure along the slider's y"
    ),
    MechanicsParameter(
        "pushing_height", "m", 0.0, -0.03, 0.03, 0.005, "pressure", "height of the push times the friction of the table"
    ),
    MechanicsParameter("body_anisotropy", "1", 0.0, -0.8, 0.8, 0.1, "pressure", "less friction along the slider's x"),
    MechanicsParameter(
        "body_anisotropy_diagonal", "1", 0.0, -0.8, 0.8, 0.1, "pressure", "less friction along the slider's diagonal"
    ),
    MechanicsParameter(
        "tracker_rotation", "rad", 0.0, -0.35, 0.35, 0.03, "measurement", "rotation of the slider in its tracked frame"
    ),
    MechanicsParameter(
        "push_rotation", "rad", 0.0, -0.35, 0.35, 0.03, "measurement", "true push direction minus the recorded one"
    ),
    MechanicsParameter(
        "outline_x", "m", 0.0, -0.02, 0.02, 0.002, "measurement", "shift of the slider in its tracked frame along x"
    ),
    MechanicsParameter(
        "outline_y", "m", 0.0, -0.02, 0.02, 0.002, "measurement", "shift of the slider in its tracked frame along y"
    ),
    MechanicsParameter(
        "radius_error", "m", 0.0, -0.004, 0.01, 0.001, "measurement", "true pusher radius minus that of the rig file"
    ),
    MechanicsParameter(
        "tip_offset_along", "m", 0.0, -0.01, 0.01, 0.001, "measurement", "true minus recorded tip, along the push"
    ),
    MechanicsParameter(
        "tip_offset_across", "m", 0.0, -0.01, 0.01, 0.001, "measurement", "true minus recorded tip, left of the push"
    ),
    MechanicsParameter("clock_delay", "s", 0.0, -0.2, 0.2, 0.01, "measurement", "age of the recorded tip position"),
    MechanicsParameter(
        "travel_share", "1", 0.0, -0.5, 0.5, 0.02, "measurement", "true over recorded path length, minus 1"
    ),
    MechanicsParameter(
        "grain_x", "1", 0.0, -0.8, 0.8, 0.1, "world", "less friction of the table along world x", _HEADING
    ),
    MechanicsParameter(
        "grain_diagonal", "1", 0.0, -0.8, 0.8, 0.1, "world", "less friction of the table along the diagonal", _HEADING
    ),
    MechanicsParameter(
        "slope_x", "1", 0.0, -0.7, 0.7, 0.05, "world", "pull of a slope along world x over sliding friction", _HEADING
    ),
    MechanicsParameter(
        "slope_y", "1", 0.0, -0.7, 0.7, 0.05, "world", "pull of a slope along world y over sliding friction", _HEADING
    ),
    MechanicsParameter(
        "gradient_x", "1/m", 0.0, -20.0, 20.0, 2.0, "world", "relative growth of friction along world x", _HEADING
    ),
    MechanicsParameter(
        "gradient_y", "1/m", 0.0, -20.0, 20.0, 2.0, "world", "relative growth of friction along world y", _HEADING
    ),
    MechanicsParameter(
        "inertia", "s^2/m", 0.0, 0.0, 2.0, 0.3, "world", "inertia: 1 / (friction of the table times gravity)"
    ),
)
BY_NAME = {parameter.name: parameter for parameter in PARAMETERS}


def parameter_table() -> str:
    """All parameters as a Markdown table, for docs and reports."""
    head = ["| parameter | part | unit | textbook | range | prior sd | meaning |", "|" + " --- |" * 7]
    rows = [
        f"| `{p.name}` | {p.part} | {p.unit} | {p.textbook:g} | {_minus(p.low)} to {_minus(p.high)} | {p.spread:g} "
        f"| {p.meaning}{' *' if p.needs else ''} |"
        for p in PARAMETERS
    ]
    return "\n".join([*head, *rows])


def _minus(value: float) -> str:
    return f"{value:g}".replace("-", "\N{MINUS SIGN}")
