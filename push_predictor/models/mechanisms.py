# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Mechanisms that can change the outcome of a push: each changes parameters of the mechanics.

To add one, add its parameters to mechanics/parameters.py and the kernel, and a line each to the table here
(docs/how_to/new_mechanism.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from push_predictor.models.mechanics.fitted import DIFFERENCE, FittedMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.pushes import Push
from push_predictor.types import Array


@dataclass(frozen=True)
class Parameter:
    """A physical quantity with its unit; it is zero in the base model.

    largest: largest absolute value that a rig can have; fits stay within it.
    """

    name: str
    unit: str
    largest: float


@dataclass(frozen=True)
class Mechanism:
    """A mechanism that the base model lacks, or has with another value.

    quantities: the parameters of mechanics/parameters.py that it changes, one for each of its own. noun: what it
    changes, in prose. onset: a clause for a change at one point, if there is an apt one.
    """

    name: str
    quantities: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    noun: str
    onset: str = ""

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the covariates that the mechanism itself depends on, in addition to those of its basis."""
        return ("slider_heading",) if any(BY_NAME[name].needs for name in self.quantities) else ()

    def response(self, mechanics: FittedMechanics, push: Push, difference: float = DIFFERENCE) -> Array:
        """Derivatives (n, 3, p) of the outcome (m, m, rad, push frame) by the parameters, by central differences.

        difference: see FittedMechanics.shifted; with a long one, secants.
        """
        unchanged = np.zeros((len(push.inputs), len(self.quantities)))
        return mechanics.shifted(self.quantities, unchanged, push, difference)[1].transpose(0, 2, 1)

    def plausible(self, values: Array) -> bool:
        """Whether a rig could have these values (n, p) of the parameters."""
        return bool(np.all(np.abs(values) <= [parameter.largest for parameter in self.parameters]))


_Row: TypeAlias = tuple[str, str, str, float, str]

# What changes, in prose.
NOUNS = {
    "contact_friction": "contact friction",
    "contact_asymmetry": "the difference between contact friction to the left and to the right",
    "pressure_spread": "the spread of the slider's pressure on the table",
    "centre_of_friction": "the slider's centre of friction",
    "pushing_height": "the pushing height",
    "body_anisotropy": "direction-dependent friction of the slider",
    "anisotropic_friction": "direction-dependent friction of the table",
    "friction_gradient": "the friction gradient across the table",
    "tilted_surface": "the tilt of the table",
    "inertia": "the slider's inertia",
    "pusher_radius": "the pusher's radius",
    "pusher_travel": "the distance that the pusher travels",
    "friction_by_angle": "the change of contact friction with the push angle",
    "friction_by_speed": "the change of contact friction with sliding speed",
    "friction_by_load": "the change of contact friction with the normal force",
    "rim_pressure": "the growth of the slider's pressure towards its rim",
    "outline_shift": "the position of the slider's outline in its tracked frame",
    "tip_offset": "the offset of the pusher's tip",
    "outline_rotation": "the rotation of the slider's outline in its tracked frame",
    "push_rotation": "the rotation of the recorded push direction",
}
ONSETS = {
    "body_anisotropy": "the slider's friction became direction-dependent",
    "anisotropic_friction": "the table's friction became direction-dependent",
}


def _mechanisms(*rows: _Row) -> tuple[Mechanism, ...]:
    """Mechanisms from one row for each of their parameters.

    A row is the mechanism's name, what it changes of mechanics/parameters.py, unit, largest, and what the change is.
    """
    found = []
    for name in dict.fromkeys(row[0] for row in rows):
        own = [row for row in rows if row[0] == name]
        parameters = tuple(Parameter(meaning, unit, largest) for _, _, unit, largest, meaning in own)
        found.append(Mechanism(name, tuple(row[1] for row in own), parameters, NOUNS[name], ONSETS.get(name, "")))
    return tuple(found)


LIBRARY: tuple[Mechanism, ...] = _mechanisms(
    ("contact_friction", "contact_friction", "1", 1.0, "change of the contact friction"),
    ("contact_asymmetry", "friction_difference", "1", 1.0, "contact friction in slip to the left less the mean"),
    ("pressure_spread", "pressure_spread", "1", 1.0, "logarithm of the factor on the pressure's spread"),
    ("centre_of_friction", "centre_x", "m", 0.05, "shift along the body's x"),
    ("centre_of_friction", "centre_y", "m", 0.05, "shift along the body's y"),
    ("pushing_height", "pushing_height", "m", 0.05, "height of the push times surface friction"),
    ("body_anisotropy", "body_anisotropy", "1", 0.8, "anisotropy along the body's x"),
    ("body_anisotropy", "body_anisotropy_diagonal", "1", 0.8, "anisotropy along its diagonal"),
    ("anisotropic_friction", "grain_x", "1", 0.8, "anisotropy along the world's x"),
    ("anisotropic_friction", "grain_diagonal", "1", 0.8, "anisotropy along the diagonal"),
    ("friction_gradient", "gradient_x", "1/m", 50.0, "relative rise of friction along the world's x"),
    ("friction_gradient", "gradient_y", "1/m", 50.0, "the same along y"),
    ("tilted_surface", "slope_x", "1", 0.7, "pull along the world's x, share of friction"),
    ("tilted_surface", "slope_y", "1", 0.7, "the same along y"),
    ("inertia", "inertia", "s^2/m", 3.0, "inverse of surface friction times gravity"),
    ("pusher_radius", "radius_error", "m", 0.004, "change of the pusher's radius"),
    ("pusher_travel", "travel_share", "1", 0.5, "relative change of the pusher's path length"),
)

# Most of these mimic one of the library, so they are candidates only once that has shown that an analytical model is
# wrong (residuals/selection/search.py).
REFINEMENTS: tuple[Mechanism, ...] = _mechanisms(
    ("friction_by_angle", "friction_by_angle", "1/rad", 0.5, "change of contact friction with push angle"),
    ("friction_by_speed", "friction_by_speed", "1", 0.2, "contact friction per e-fold of sliding speed"),
    ("friction_by_load", "friction_by_load", "1", 0.5, "contact friction per e-fold of normal force"),
    ("rim_pressure", "rim_exponent", "1", 12.0, "exponent of the pressure's growth towards the rim"),
    ("outline_shift", "outline_x", "m", 0.02, "shift of the outline along the body's x"),
    ("outline_shift", "outline_y", "m", 0.02, "shift of the outline along the body's y"),
    ("tip_offset", "tip_offset_along", "m", 0.01, "true minus recorded tip, along the push"),
    ("tip_offset", "tip_offset_across", "m", 0.01, "true minus recorded tip, left of the push"),
    ("outline_rotation", "tracker_rotation", "rad", 0.35, "rotation of the outline in its tracked frame"),
    ("push_rotation", "push_rotation", "rad", 0.35, "true push direction minus the recorded one"),
)

_BY_NAME = {mechanism.name: mechanism for mechanism in (*LIBRARY, *REFINEMENTS)}
LARGEST = {
    quantity: parameter.largest
    for mechanism in _BY_NAME.values()
    for quantity, parameter in zip(mechanism.quantities, mechanism.parameters, strict=True)
}


def mechanism_named(name: str) -> Mechanism:
    """The mechanism of that name. Raises KeyError if there is none."""
    return _BY_NAME[name]
