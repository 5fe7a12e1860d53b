# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of the forward model: one table of names, units, textbook values, plausible ranges and priors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from push_predictor.types import Array

# Values by name: a number, or one per push (n,). A name that is missing has its textbook value.
ParameterValues: TypeAlias = Mapping[str, "float | Array"]


QUASI_STATIC = 0.06  # m/s: below, inertia moves a slider by less than 2 % of its path, and costs two thirds of the time


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


_Row: TypeAlias = tuple[str, str, float, float, float, float, str]


def _part(part: str, *rows: _Row, needs: tuple[str, ...] = ()) -> Iterator[MechanicsParameter]:
    """Parameters from rows of name, unit, textbook, low, high, spread and meaning."""
    for name, unit, textbook, low, high, spread, meaning in rows:
        yield MechanicsParameter(name, unit, textbook, low, high, spread, part, meaning, needs)


# --8<-- [start:documented]
PARAMETERS: tuple[MechanicsParameter, ...] = (
    *_part(
        "contact",
        ("contact_friction", "1", 0.3, 0.0, 1.5, 0.15, "coefficient of friction between pusher and slider"),
        ("friction_difference", "1", 0.0, -0.6, 0.6, 0.1, "contact friction in left slip minus the mean"),
        ("friction_by_angle", "1/rad", 0.0, -0.5, 0.5, 0.15, "change of contact friction with the push angle"),
        ("friction_by_speed", "1", 0.0, -0.2, 0.2, 0.05, "contact friction per e-fold of tangential speed"),
        ("friction_by_load", "1", 0.0, -0.5, 0.5, 0.1, "contact friction per e-fold of normal force"),
    ),
    *_part(
        "pressure",
        ("rim_exponent", "1", 0.0, -4.0, 12.0, 1.5, "exponent of the pressure's growth towards the rim"),
        ("pressure_spread", "1", 0.0, -1.5, 1.0, 0.1, "logarithm of a factor on the pressure's spread"),
        ("centre_x", "m", 0.0, -0.03, 0.03, 0.004, "shift of the centre of pressure along the slider's x"),
        ("centre_y", "m", 0.0, -0.03, 0.03, 0.004, "shift of the centre of pressure along the slider's y"),
        ("pushing_height", "m", 0.0, -0.03, 0.03, 0.005, "height of the push times the friction of the table"),
        ("body_anisotropy", "1", 0.0, -0.8, 0.8, 0.1, "less friction along the slider's x"),
        ("body_anisotropy_diagonal", "1", 0.0, -0.8, 0.8, 0.1, "less friction along the slider's diagonal"),
    ),
    *_part(
        "measurement",
        ("tracker_rotation", "rad", 0.0, -0.35, 0.35, 0.03, "rotation of the slider in its tracked frame"),
        ("push_rotation", "rad", 0.0, -0.35, 0.35, 0.03, "true push direction minus the recorded one"),
        ("outline_x", "m", 0.0, -0.02, 0.02, 0.002, "shift of the slider in its tracked frame along x"),
        ("outline_y", "m", 0.0, -0.02, 0.02, 0.002, "shift of the slider in its tracked frame along y"),
        ("radius_error", "m", 0.0, -0.004, 0.01, 0.001, "true pusher radius minus that of the rig file"),
        ("tip_offset_along", "m", 0.0, -0.01, 0.01, 0.001, "true minus recorded tip, along the push"),
        ("tip_offset_across", "m", 0.0, -0.01, 0.01, 0.001, "true minus recorded tip, left of the push"),
        ("clock_delay", "s", 0.0, -0.2, 0.2, 0.01, "age of the recorded tip position"),
        ("travel_share", "1", 0.0, -0.5, 0.5, 0.02, "true over recorded path length, minus 1"),
    ),
    *_part(
        "world",
        ("grain_x", "1", 0.0, -0.8, 0.8, 0.1, "less friction of the table along world x"),
        ("grain_diagonal", "1", 0.0, -0.8, 0.8, 0.1, "less friction of the table along the diagonal"),
        ("slope_x", "1", 0.0, -0.7, 0.7, 0.05, "pull of a slope along world x over sliding friction"),
        ("slope_y", "1", 0.0, -0.7, 0.7, 0.05, "pull of a slope along world y over sliding friction"),
        ("gradient_x", "1/m", 0.0, -20.0, 20.0, 2.0, "relative growth of friction along world x"),
        ("gradient_y", "1/m", 0.0, -20.0, 20.0, 2.0, "relative growth of friction along world y"),
        needs=("push_heading",),
    ),
    *_part(
        "world",
        ("inertia", "s^2/m", 0.0, 0.0, 2.0, 0.3, "inertia: 1 / (friction of the table times gravity)"),
    ),
)
# --8<-- [end:documented]
BY_NAME = {parameter.name: parameter for parameter in PARAMETERS}
