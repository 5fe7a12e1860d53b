# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Mechanisms that refine an analytical model once the library's have shown that it is wrong.

They are parameters of the forward model that the library lacks, and most of them mimic one of the library's. So they
are candidates of further steps alone (residuals/selection/further_steps.py), not of the first search.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.fitted import FittedMechanics, mechanics_of
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.types import Array

STEP = 0.5  # of a parameter's prior standard deviation


def _of(mechanics: Callable[[AnalyticalPush], FittedMechanics], *quantities: str) -> Callable[..., Array]:
    """The response to parameters of these mechanics, (n, 3, p), by central differences."""

    def response(physics: AnalyticalPush, push: Push) -> Array:
        fitted, n = mechanics(physics), len(push.inputs)

        steps = {name: STEP * BY_NAME[name].spread for name in quantities}
        ends = [(name, sign * step) for name, step in steps.items() for sign in (1.0, -1.0)]
        changes = {name: np.repeat([step * (name == own) for own, step in ends], n) for name in quantities}
        inputs, duration = np.tile(push.inputs, (len(ends), 1)), np.tile(push.duration, len(ends))
        covariates = {name: np.tile(column, len(ends)) for name, column in push.covariates.items()}
        moved = fitted.displacement(inputs, duration, covariates, changes).reshape(-1, 2, n, 3)
        columns = [(more - less) / (2.0 * step) for (more, less), step in zip(moved, steps.values(), strict=True)]
        return np.stack(columns, axis=2)

    return response


def _on_patch(physics: AnalyticalPush) -> FittedMechanics:
    """The same mechanics on the even patch of the outline: an ellipsoid has no rim."""
    fitted = mechanics_of(physics)
    return replace(fitted, mechanics=replace(fitted.mechanics, support=None))


def _refinement(name: str, quantities: dict[str, str], unit: str, largest: float) -> Mechanism:
    """The mechanism of these quantities, by name with what each is."""
    mechanics = _on_patch if "rim_exponent" in quantities else mechanics_of
    parameters = tuple(Parameter(meaning, unit, largest) for meaning in quantities.values())
    return Mechanism(name, parameters, _of(mechanics, *quantities), quantities=tuple(quantities))


REFINEMENTS: tuple[Mechanism, ...] = (
    _refinement("friction_by_angle", {"friction_by_angle": "change of contact friction with push angle"}, "1/rad", 0.5),
    _refinement("friction_by_speed", {"friction_by_speed": "contact friction per e-fold of sliding speed"}, "1", 0.2),
    _refinement("friction_by_load", {"friction_by_load": "contact friction per e-fold of normal force"}, "1", 0.5),
    _refinement("rim_pressure", {"rim_exponent": "exponent of the pressure's growth towards the rim"}, "1", 12.0),
    _refinement(
        "outline_shift",
        {
            "outline_x": "shift of the outline along the body's x",
            "outline_y": "shift of the outline along the body's y",
        },
        "m",
        0.02,
    ),
    _refinement(
        "tip_offset",
        {
            "tip_offset_along": "true minus recorded tip, along the push",
            "tip_offset_across": "true minus recorded tip, left of the push",
        },
        "m",
        0.01,
    ),
    _refinement("outline_rotation", {"tracker_rotation": "rotation of the outline in its tracked frame"}, "rad", 0.35),
    _refinement("push_rotation", {"push_rotation": "true push direction minus the recorded one"}, "rad", 0.35),
)
