# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Mechanisms that can change the outcome of a push: each changes parameters of the mechanics.

To add one, add its parameters to mechanics/parameters.py and the kernel, and a line to the table here
(docs/how_to/new_mechanism.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.models.mechanics.fitted import DIFFERENCE, FittedMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.pushes import Push
from push_predictor.types import Array


@dataclass(frozen=True)
class Parameter:
    """A physical quantity with its unit; it is zero in the base model.

    largest: largest absolute value that a rig can have. A fit that needs more mimics something else.
    """

    name: str
    unit: str
    largest: float


@dataclass(frozen=True)
class Mechanism:
    """A mechanism that the base model lacks, or has with another value.

    quantities: the parameters of mechanics/parameters.py that it changes, one for each of its own.
    """

    name: str
    quantities: tuple[str, ...]
    parameters: tuple[Parameter, ...]

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


def _mechanism(name: str, unit: str, largest: float, **quantities: str) -> Mechanism:
    """quantities: by name of a parameter of the mechanics, what its change is."""
    parameters = tuple(Parameter(meaning, unit, largest) for meaning in quantities.values())
    return Mechanism(name, tuple(quantities), parameters)


LIBRARY: tuple[Mechanism, ...] = (
    _mechanism("contact_friction", "1", 1.0, contact_friction="change of the contact friction"),
    _mechanism("contact_asymmetry", "1", 1.0, friction_difference="contact friction in slip to the left less the mean"),
    _mechanism("pressure_spread", "1", 1.0, pressure_spread="logarithm of the factor on the pressure's spread"),
    _mechanism(
        "centre_of_friction", "m", 0.05, centre_x="shift along the body's x", centre_y="shift along the body's y"
    ),
    _mechanism("pushing_height", "m", 0.05, pushing_height="height of the push times surface friction"),
    _mechanism(
        "body_anisotropy",
        "1",
        0.8,
        body_anisotropy="anisotropy along the body's x",
        body_anisotropy_diagonal="anisotropy along its diagonal",
    ),
    _mechanism(
        "anisotropic_friction",
        "1",
        0.8,
        grain_x="anisotropy along the world's x",
        grain_diagonal="anisotropy along the diagonal",
    ),
    _mechanism(
        "friction_gradient",
        "1/m",
        50.0,
        gradient_x="relative rise of friction along the world's x",
        gradient_y="the same along y",
    ),
    _mechanism(
        "tilted_surface", "1", 0.7, slope_x="pull along the world's x, share of friction", slope_y="the same along y"
    ),
    _mechanism("inertia", "s^2/m", 3.0, inertia="inverse of surface friction times gravity"),
    _mechanism("pusher_radius", "m", 0.004, radius_error="change of the pusher's radius"),
    _mechanism("pusher_travel", "1", 0.5, travel_share="relative change of the pusher's path length"),
)

# Most of these mimic one of the library, so they are candidates only once that has shown that an analytical model is
# wrong (residuals/selection/further_steps.py).
REFINEMENTS: tuple[Mechanism, ...] = (
    _mechanism("friction_by_angle", "1/rad", 0.5, friction_by_angle="change of contact friction with push angle"),
    _mechanism("friction_by_speed", "1", 0.2, friction_by_speed="contact friction per e-fold of sliding speed"),
    _mechanism("friction_by_load", "1", 0.5, friction_by_load="contact friction per e-fold of normal force"),
    _mechanism("rim_pressure", "1", 12.0, rim_exponent="exponent of the pressure's growth towards the rim"),
    _mechanism(
        "outline_shift",
        "m",
        0.02,
        outline_x="shift of the outline along the body's x",
        outline_y="shift of the outline along the body's y",
    ),
    _mechanism(
        "tip_offset",
        "m",
        0.01,
        tip_offset_along="true minus recorded tip, along the push",
        tip_offset_across="true minus recorded tip, left of the push",
    ),
    _mechanism("outline_rotation", "rad", 0.35, tracker_rotation="rotation of the outline in its tracked frame"),
    _mechanism("push_rotation", "rad", 0.35, push_rotation="true push direction minus the recorded one"),
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
