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

"""Effects of an extended model from a table: what the mechanics do under their changes, in microseconds.

A shift by effects is a difference of two integrations of the mechanics, and its covariance takes two more for each
parameter that changes. Displacement and derivatives are tabulated over the place of the push, its angle and speed, the
heading where the mechanics depend on it, and the changes of the parameters. How these follow from covariates is
computed as ever. Where a contact begins to slip the mechanics bend within some hundredths of a radian, which a table
smooths: so the table is compared with the model, and used only where its errors are small next to the noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.models.effects.coefficients import changed_names
from push_predictor.models.effects.effect import responses_of
from push_predictor.models.effects.exact import (
    Changes,
    displaced,
    slopes_of,
    sums_of,
    within_limits,
)
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanisms import Push
from push_predictor.models.predictors import (
    AnalyticalPredictor,
    ExtendedPredictor,
    GaussianProcessPredictor,
    MechanicsPredictor,
)
from push_predictor.models.predictors.predictor import Shift
from push_predictor.models.tabulated.effect_tables.axes import STEPPED, ChangeAxes, PlaceAxis
from push_predictor.models.tabulated.interpolation import TensorSpline
from push_predictor.types import Array, BoolArray, IntArray

TURN = 2.0 * np.pi
MARGIN = 1e-6  # of an angle, rad, and of a speed, relative
ONE_SPEED = 1.02  # ratio of the largest to the smallest speed, up to which they count as one


@dataclass(frozen=True, eq=False)
class EffectSource:
    """What a table of effects contains, from the mechanics themselves.

    duration: of all pushes, s. names: the parameters that the exact effects change, in the table's order.
    """

    predictor: ExtendedPredictor
    duration: float

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that change."""
        return changed_names(self.predictor.effects)

    @cached_property
    def spreads(self) -> Array:
        """Usual sizes (q,) of these parameters, the units of their changes in a table."""
        return np.array([BY_NAME[name].spread for name in self.names])

    @property
    def anchored(self) -> bool:
        """Whether the values contain the displacement of the base's mechanics: wherever the base adds to it."""
        base = self.predictor.base
        about_mean = isinstance(base, GaussianProcessPredictor) and base.mean is not None
        return about_mean or isinstance(base, AnalyticalPredictor | MechanicsPredictor)

    def moved(self, inputs: Array, heading: Array, changes: Array) -> Array:
        """Displacement (n, 3) of pushes (n, 3) by the changed mechanics.

        heading (n,): of the inward normal in the world, rad; changes (n, q) in units of spreads.
        """
        push = self._push(inputs, heading)
        return np.asarray(displaced(self.predictor.mechanics, [self._by_name(changes)], push)[0])

    def still(self, inputs: Array, heading: Array) -> Array:
        """What is to be added (n, 3) to `moved`: minus the displacement without changes, plus the base's own."""
        push = self._push(inputs, heading)
        return np.asarray(self.anchor(push) - displaced(self.predictor.mechanics, [{}], push)[0])

    def slopes(self, inputs: Array, heading: Array, changes: Array) -> Array:
        """Derivatives (n, 3 p) of the shift by p parameters: those that change, then those of each linear effect."""
        push = self._push(inputs, heading)
        of_parameter = slopes_of(self.predictor.mechanics, self._by_name(changes), push)
        columns = [of_parameter[name] for name in self.names]
        for effect in self.predictor.effects:
            if not effect.exact:
                responses = responses_of(effect.mechanism, self.predictor.physics, push, effect.outcome_scale)
                columns += [responses[:, :, k] for k in range(responses.shape[2])]
        return np.concatenate(columns, axis=1)

    def _by_name(self, changes: Array) -> Changes:
        return within_limits(dict(zip(self.names, (changes * self.spreads).T, strict=True)))

    def changes(self, push: Push) -> tuple[Array, Array]:
        """Changes (n, q) of the parameters by stepped and by other effects at n pushes, in units of spreads."""
        n, effects = len(push.inputs), [effect for effect in self.predictor.effects if effect.exact]
        parts = [
            [effect for effect in effects if (effect.basis.name in STEPPED) is stepped] for stepped in (True, False)
        ]
        stepped, flowing = (sums_of(part, push) for part in parts)
        return self._stacked(stepped, n), self._stacked(flowing, n)

    def _stacked(self, changes: Changes, n: int) -> Array:
        columns = [changes.get(name, np.zeros(n)) for name in self.names]
        return np.stack(columns, axis=1) / self.spreads if columns else np.zeros((n, 0))

    def anchor(self, push: Push) -> Array:
        """Displacement (n, 3) of the base's mechanics if anchored, else zero."""
        base = self.predictor.base
        if isinstance(base, GaussianProcessPredictor):
            return base.displacement(push)
        return base.moments(push).mean if self.anchored else np.zeros((len(push.inputs), 3))

    def _push(self, inputs: Array, heading: Array) -> Push:
        normal = self.predictor.physics.outline.inward_normal(inputs[:, 1])
        slider = heading - np.arctan2(normal[:, 1], normal[:, 0])
        headings = {"slider_heading": slider, "push_heading": heading + inputs[:, 2]}
        return Push(inputs, np.full(len(inputs), self.duration), headings)


@dataclass(frozen=True, eq=False)
class Located:
    """Where n pushes lie in a table: points (n, d), boxes (n,), speeds (n,) m/s; inside (n,), whether they do."""

    points: Array
    box: IntArray
    speed: Array
    inside: BoolArray


@dataclass(frozen=True, eq=False)
class EffectAxes:
    """The axes of a table of effects, and what it contains.

    angles: range, rad. speeds: range at the duration of the source, m/s. any_duration: whether another duration does
    the same as another speed. linear_range: lows and highs (l,), margin included, of the basis values that go with the
    coefficients in which the shift is linear: an error of a derivative grows with them. later: whether the ranges
    contain later pushes than those of the training.
    """

    source: EffectSource
    later: bool
    place: PlaceAxis
    change: ChangeAxes
    linear_range: tuple[Array, Array]
    angles: tuple[float, float]
    speeds: tuple[float, float]
    by_heading: bool
    any_duration: bool

    @cached_property
    def by_speed(self) -> bool:
        """Whether the speeds differ."""
        return self.speeds[1] > ONE_SPEED * self.speeds[0]


@dataclass(frozen=True, eq=False)
class EffectTable(EffectAxes):
    """A table of effects.

    spline: the shift (3) and its derivatives (3 p) by p parameters, per speed, over place, angle, and, where they
    matter, speed, heading and changes.
    """

    spline: TensorSpline

    def located(self, push: Push) -> Located:
        """Where n pushes, with all covariates that the effects need, lie in the table."""
        velocity, contact, angle = push.inputs.T
        ratio = push.duration / self.source.duration
        speed = velocity * ratio
        edge, place = self.place.located(contact)
        level, places, inside = self.change.located(*self.source.changes(push))
        columns = [place, np.clip(angle, *self.angles)]
        inside = inside & _within(angle, self.angles, MARGIN) & _within(speed, self.speeds, MARGIN * self.speeds[1])
        if not self.any_duration:
            inside = inside & (np.abs(ratio - 1.0) <= MARGIN)
        if (linear := self.source.predictor.coefficients.linear).any():
            factors, (low, high) = self._columns(push)[:, linear], self.linear_range
            inside = inside & np.all((factors >= low) & (factors <= high), axis=1)
        if self.by_speed:
            columns.append(np.clip(speed, *self.speeds))
        if self.by_heading:
            heading, agree = self._heading(push)
            columns.append(heading)
            inside = inside & agree
        points = np.column_stack([*columns, places])
        return Located(points, edge * len(self.change.levels) + level, speed, inside)

    def _heading(self, push: Push) -> tuple[Array, BoolArray]:
        """World headings (n,) of the inward normal, -pi to pi, and whether slider and push agree about them."""
        found, given = [], push.covariates
        if "push_heading" in given:
            found.append(given["push_heading"] - push.inputs[:, 2])
        if "slider_heading" in given:
            normal = self.place.outline.inward_normal(push.inputs[:, 1])
            found.append(given["slider_heading"] + np.arctan2(normal[:, 1], normal[:, 0]))
        turned = [(heading + np.pi) % TURN - np.pi for heading in found]
        agree = np.abs((found[0] - found[-1] + np.pi) % TURN - np.pi) <= MARGIN
        return turned[-1], agree

    def shift(self, push: Push, located: Located) -> Shift:
        """The shift by all effects at pushes inside, with the displacement of the base's mechanics if anchored."""
        known, speed = self.source.predictor.coefficients, located.speed[:, None]
        values = (self.spline(located.points, located.box) * speed).reshape(len(speed), -1, 3)
        mean, by_parameter = values[:, 0], values[:, 1:]
        design = by_parameter[:, known.parameter] * self._columns(push)[:, :, None]
        if known.linear.any():
            mean = mean + np.einsum("nmk,m->nk", design, known.values * known.linear)
        return Shift(mean, design.transpose(0, 2, 1) @ known.covariance @ design)

    def _columns(self, push: Push) -> Array:
        return basis_columns(self.source.predictor, push)


def basis_columns(predictor: ExtendedPredictor, push: Push) -> Array:
    """The basis values (n, m) that go with the coefficients of all effects."""
    parts = []
    for effect in predictor.effects:
        values = effect.basis.values(push.covariates, len(push.inputs))
        parts.append(np.tile(values, (1, len(effect.coefficients) // values.shape[1])))
    return np.concatenate(parts, axis=1)


def _within(values: Array, ends: tuple[float, float], margin: float) -> BoolArray:
    return np.asarray((values >= ends[0] - margin) & (values <= ends[1] + margin))
