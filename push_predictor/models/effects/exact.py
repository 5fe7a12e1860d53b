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

"""Effects as changes of parameters of the mechanics: exact for large changes, and together, since changes add up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.models.effects.effect import Effect, mechanism_named, products
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanisms import LIBRARY, REFINEMENTS, Push
from push_predictor.types import Array

# Of a parameter's prior standard deviation: a shorter step of a derivative would show errors of the integration.
DIFFERENCE = 0.5

LARGEST = {
    name: parameter.largest
    for mechanism in (*LIBRARY, *REFINEMENTS)
    if mechanism.quantities
    for name, parameter in zip(mechanism.quantities, mechanism.parameters, strict=True)
}

Changes = dict[str, Array]  # by name of a parameter: its change (n,) at each push


@dataclass(frozen=True, eq=False)
class Mechanics:
    """What effects act on: the analytical model, for linear effects, and the base's own mechanics, for exact ones."""

    physics: AnalyticalPush
    fitted: FittedMechanics


@dataclass(frozen=True, eq=False)
class JointShift:
    """Shift (n, 3) of the mean; per effect, its derivatives (n, 3, p * m) by the coefficients.

    of_parameter: those (n, 3) by each parameter of the mechanics that exact effects change.
    """

    shift: Array
    designs: list[Array]
    of_parameter: Changes

    def responses(self, effect: Effect) -> Array:
        """Derivatives (n, 3, p) by the parameters that an exact effect changes."""
        return _stacked(self.of_parameter, effect)


def joint_shifts(mechanics: Mechanics, alternatives: Sequence[Sequence[Effect]], push: Push, unchanged: Array) -> Array:
    """Shifts (k, n, 3) of the mean by the exact effects of each of k sets, computed as one set of pushes.

    unchanged (n, 3): what `undisturbed` returns.
    """
    exact = [[effect for effect in effects if effect.exact] for effects in alternatives]
    return displaced(mechanics.fitted, [changes_of(effects, push) for effects in exact], push, unchanged) - unchanged


def has_exact_effects(mechanism: str | None) -> bool:
    """Whether the forward model has the parameters of a mechanism."""
    return mechanism is not None and bool(mechanism_named(mechanism).quantities)


def joint_shift(mechanics: Mechanics, effects: Sequence[Effect], push: Push) -> Array:
    """Shift of the mean (n, 3) by all effects together."""
    return joint(mechanics, effects, push, derivatives=False).shift


def undisturbed(mechanics: Mechanics, push: Push) -> Array:
    """Displacements (n, 3) by the mechanics without effects."""
    return np.asarray(displaced(mechanics.fitted, [{}], push)[0])


def joint(
    mechanics: Mechanics,
    effects: Sequence[Effect],
    push: Push,
    *,
    derivatives: bool = True,
    unchanged: Array | None = None,
) -> JointShift:
    """The shift by all effects together, and where they act its derivatives by their coefficients.

    unchanged (n, 3): what `undisturbed` returns, where it is known from before.
    """
    exact, n = [effect for effect in effects if effect.exact], len(push.inputs)
    changes = changes_of(exact, push)
    ends = {name: _ends(name, change) for name, change in changes.items()} if derivatives else {}
    tried = [{**changes, name: end} for name, both in ends.items() for end in both]
    if not exact:
        moved = np.zeros((2, n, 3))
    elif unchanged is None:
        moved = displaced(mechanics.fitted, [{}, changes, *tried], push)
    else:
        moved = np.concatenate([unchanged[None], displaced(mechanics.fitted, [changes, *tried], push, unchanged)])
    of_parameter = _slopes(ends, moved[2:])
    shift, designs = moved[1] - moved[0], []
    for effect in effects:
        if not effect.exact:
            design = effect.design(mechanics.physics, push)
            shift = shift + design @ effect.coefficients
            designs.append(design)
        elif derivatives:
            designs.append(products(_stacked(of_parameter, effect), effect.basis.values(push.covariates, n)))
    return JointShift(shift, designs, of_parameter)


def slopes_of(mechanics: FittedMechanics, changes: Changes, push: Push) -> Changes:
    """Derivatives (n, 3) of the displacement under changes, by each parameter that changes."""
    ends = {name: _ends(name, change) for name, change in changes.items()}
    tried = [{**changes, name: end} for name, both in ends.items() for end in both]
    return _slopes(ends, displaced(mechanics, tried, push)) if tried else {}


def _slopes(ends: dict[str, tuple[Array, Array]], moved: Array) -> Changes:
    """Derivatives (n, 3) from displacements (2 q, n, 3) at both ends of q changes."""
    return {
        name: (moved[2 * k + 1] - moved[2 * k]) / (high - low)[:, None]
        for k, (name, (low, high)) in enumerate(ends.items())
    }


def changes_of(effects: Sequence[Effect], push: Push) -> Changes:
    """The sum of all effects' changes of each parameter, at most the largest that a rig can have."""
    return within_limits(sums_of(effects, push))


def within_limits(changes: Changes) -> Changes:
    """Changes of at most the largest that a rig can have."""
    return {name: np.clip(change, -LARGEST[name], LARGEST[name]) for name, change in changes.items()}


def sums_of(effects: Sequence[Effect], push: Push) -> Changes:
    """The sum of all effects' changes of each parameter."""
    n, total = len(push.inputs), Changes()
    for effect in effects:
        values = effect.basis.values(push.covariates, n)
        strengths = effect.coefficients.reshape(-1, values.shape[1]) @ values.T
        for name, strength in zip(quantities_of(effect), strengths, strict=True):
            total[name] = total.get(name, 0.0) + strength
    return total


def displaced(
    mechanics: FittedMechanics, tried: Sequence[Changes], push: Push, unchanged: Array | None = None
) -> Array:
    """Displacements (k, n, 3) with each of k sets of changes, computed as one set of pushes.

    The heading of a push follows from that of the slider. unchanged (n, 3): those of pushes that nothing changes, which
    are then not computed again.
    """
    n, k, given = len(push.inputs), len(tried), dict(push.covariates)
    names = {name for changes in tried for name in changes}
    if any(BY_NAME[name].needs for name in (*names, *mechanics.values)) and "slider_heading" in given:
        normal = mechanics.mechanics.outline.inward_normal(push.inputs[:, 1])
        given["push_heading"] = given["slider_heading"] + np.arctan2(normal[:, 1], normal[:, 0]) + push.inputs[:, 2]
    covariates = {name: np.tile(column, k) for name, column in given.items()}
    columns = {name: np.concatenate([changes.get(name, np.zeros(n)) for changes in tried]) for name in sorted(names)}
    inputs, duration = np.tile(push.inputs, (k, 1)), np.tile(push.duration, k)
    if unchanged is None:
        return mechanics.displacement(inputs, duration, covariates, columns).reshape(k, n, 3)
    moved, some = np.tile(unchanged, (k, 1)), np.any([column != 0.0 for column in columns.values()], axis=0)
    covariates, columns = ({name: one[some] for name, one in each.items()} for each in (covariates, columns))
    moved[some] = mechanics.displacement(inputs[some], duration[some], covariates, columns)
    return moved.reshape(k, n, 3)


def _ends(name: str, change: Array) -> tuple[Array, Array]:
    """Changes (n,) below and above, between which a derivative is taken, within the largest change."""
    step, largest = DIFFERENCE * BY_NAME[name].spread, LARGEST[name]
    return np.maximum(change - step, -largest), np.minimum(change + step, largest)


def _stacked(of_parameter: Changes, effect: Effect) -> Array:
    """Derivatives (n, 3, p) by the parameters of an effect, from those by name."""
    return np.stack([of_parameter[name] for name in quantities_of(effect)], axis=2)


def quantities_of(effect: Effect) -> tuple[str, ...]:
    """Names of the parameters that an exact effect changes."""
    return mechanism_named(str(effect.mechanism)).quantities
