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

from push_predictor.models.effects.effect import Effect, products
from push_predictor.models.mechanics.fitted import Changes, FittedMechanics, ends_of, slopes_between
from push_predictor.models.mechanisms import LARGEST
from push_predictor.models.push import Push
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class JointShift:
    """Shift (n, 3) of the mean; per effect, its derivatives (n, 3, p * m) by the coefficients.

    of_parameter: those (n, 3) by each parameter of the mechanics that effects change.
    """

    shift: Array
    designs: list[Array]
    of_parameter: dict[str, Array]

    def responses(self, effect: Effect) -> Array:
        """Derivatives (n, 3, p) by the parameters that an effect changes."""
        return np.stack([self.of_parameter[name] for name in effect.quantities], axis=2)


def joint_shift(mechanics: FittedMechanics, effects: Sequence[Effect], push: Push) -> Array:
    """Shift of the mean (n, 3) by all effects together."""
    return joint(mechanics, effects, push, derivatives=False).shift


def joint(mechanics: FittedMechanics, effects: Sequence[Effect], push: Push, *, derivatives: bool = True) -> JointShift:
    """The shift by all effects together, and its derivatives by their coefficients."""
    n, changes = len(push.inputs), changes_of(effects, push)
    ends = {name: ends_of(name, mechanics.value(name), c) for name, c in changes.items()} if derivatives else {}
    tried = [{**changes, name: end} for name, both in ends.items() for end in both]
    moved = mechanics.displacements([{}, changes, *tried], push) if changes else np.zeros((2, n, 3))
    of_parameter = slopes_between(ends, moved[2:])
    together = JointShift(moved[1] - moved[0], [], of_parameter)
    shift, designs = together.shift, together.designs
    for effect in effects:
        if not effect.exact:
            designs.append(effect.design(mechanics, push))
            shift = shift + designs[-1] @ effect.coefficients
        elif derivatives:
            designs.append(products(together.responses(effect), effect.basis.values(push.covariates, n)))
    return JointShift(shift, designs, of_parameter)


def changes_of(effects: Sequence[Effect], push: Push) -> Changes:
    """The sum of all effects' changes of each parameter, at most the largest that a rig can have."""
    return within_limits(sums_of(effects, push))


def within_limits(changes: Changes) -> Changes:
    """Changes of at most the largest that a rig can have."""
    return {name: np.clip(change, -LARGEST[name], LARGEST[name]) for name, change in changes.items()}


def sums_of(effects: Sequence[Effect], push: Push) -> Changes:
    """The sum of all effects' changes of each parameter."""
    n, total = len(push.inputs), dict[str, Array]()
    for effect in effects:
        if not effect.exact:
            continue
        values = effect.basis.values(push.covariates, n)
        strengths = effect.coefficients.reshape(-1, values.shape[1]) @ values.T
        for name, strength in zip(effect.quantities, strengths, strict=True):
            total[name] = total[name] + strength if name in total else strength
    return total
