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

"""A push model that predicts from a table, in microseconds.

A prediction of a learnt model reads six dense factors of n^2 / 2 numbers, but it is a smooth function of at most three
inputs. So it is tabulated once: for all contacts, all angles and up to twice the speeds of its training, or in its
domain alone where that would be too large. The table is compared with the model and used only if it is accurate. Every
other push and every other model is predicted by the model itself.

The mechanics have no table, neither alone nor as the mean of a learnt model: they have kinks where contacts begin to
slip, and a table would have to be very fine there. A single push is computed in plain numbers instead. A prior model
averages over many parameters, and has a coarse table of its own (tabulated_prior). Effects take several integrations a
push: `with_effect_table` tabulates them, with the mechanics that they change (effect_tables).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from push_predictor.models.mechanisms import Push
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors import (
    AnalyticalPredictor,
    GaussianProcessPredictor,
    MechanicsPredictor,
    Moments,
    PriorPredictor,
    Shift,
)
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.effect_tables.build import build_effect_table
from push_predictor.models.tabulated.effect_tables.single import SingleEffects
from push_predictor.models.tabulated.effect_tables.table import EffectTable
from push_predictor.models.tabulated.prediction_table import OnGrid, TooFineError, on_grid
from push_predictor.models.tabulated.table_accuracy import Probes, TableAccuracy, probed
from push_predictor.models.tabulated.tabulated_domain import (
    FeatureBox,
    TabulatedDomain,
    feature_box,
    narrow_box,
    tabulated_domain,
    wide_box,
)
from push_predictor.models.tabulated.tabulated_prior import tabulated_prior
from push_predictor.types import Array, BoolArray

MECHANICS = (AnalyticalPredictor, MechanicsPredictor)
ONLY_LEARNT = "exact: only learnt models have a table"
REFINEMENTS = (0.8, 1.0, 1.3, 1.7, 2.2)  # of a table, tried in turn


@dataclass(frozen=True, eq=False)
class TabulatedModel:
    """A model with its table. domain, which has the table, and error are None if there is none.

    base_how: in words, how its base predicts. effects: the table of its effects, None if they are computed;
    effects_how: the same in words.

    A push gets the same prediction alone as among others, to rounding. Made by `tabulate`.
    """

    model: PushModel
    base_how: str
    domain: TabulatedDomain | None = None
    error: TableAccuracy | None = None
    effects: EffectTable | None = None
    effects_how: str = ""

    @property
    def how(self) -> str:
        """In words, how it predicts."""
        return f"{self.base_how}; effects: {self.effects_how}" if self.effects_how else self.base_how

    @property
    def tabulated(self) -> bool:
        """Whether pushes are predicted from a table."""
        return self.domain is not None

    def predict_rows(self, inputs: Array, duration: Array, covariates: Mapping[str, Array] | None = None) -> Prediction:
        """Like PushModel.predict; in its table within the tolerances of table_accuracy, elsewhere the same.

        Of an extended model the base is tabulated. Its effects are computed and added, unless they have a table.
        """
        found, tails = self._predicted(Push(inputs, duration, covariates or {})), self.model.predictor.tails
        if found.tails is tails:
            return found
        return Prediction(found.mean, found.covariance, found.process_covariance, found.in_domain, tails)

    def _predicted(self, push: Push) -> Prediction:
        if self.effects is None:
            return self._computed(push)
        push = self.model.predictor.completed(push)
        if len(push.inputs) == 1:
            alone = self._single_effects.shift(push)
            return self._computed(push) if alone is None else self._shifted(push, alone)
        located = self.effects.located(push)
        if located.inside.all():
            return self._shifted(push, self.effects.shift(push, located))
        if not located.inside.any():
            return self._computed(push)
        chosen, other = (push.take(rows) for rows in (located.inside, ~located.inside))
        table = self._shifted(chosen, self.effects.shift(chosen, self.effects.located(chosen)))
        return _merged(located.inside, table, self._computed(other))

    def _shifted(self, push: Push, shift: Shift) -> Prediction:
        """Predictions from what the base adds to a table of effects, and the shift in that table; push: completed."""
        n = len(push.inputs)
        seen = self.model.in_covariate_ranges(push.covariates, n)
        if (noise := self._noise) is not None:
            process = noise[None].repeat(n, axis=0)
            return Prediction(shift.mean, process + shift.covariance, process, self._in_domain(push.inputs) & seen)
        rest, factor = self._added(push), self._factor
        return Prediction(
            rest.mean + shift.mean,
            rest.covariance * factor + shift.covariance,
            rest.process_covariance * factor,
            rest.in_domain & seen,
        )

    def _computed(self, push: Push) -> Prediction:
        """Predictions with the effects computed."""
        base, predictor = self._base(push), self._exact.predictor
        if not predictor.effects and not self.model.covariate_ranges:
            return base
        inside = base.in_domain & self.model.covariates_seen(push)
        return Prediction(*predictor.with_effects(_moments(base), push), inside)

    def _base(self, push: Push) -> Prediction:
        """Predictions of the base; covariates are not looked at. The domain of one push is found in numbers."""
        if self.domain is not None:
            return self._of_base(self._learnt(self.domain, push.inputs, push.duration), push)
        if len(push.inputs) == 1 and isinstance(self.model.predictor.base, MECHANICS):
            return Prediction(*self._exact.predictor.base.moments(push), self._in_domain(push.inputs))
        return self._exact.base.predict_rows(push.inputs, push.duration, push.covariates)

    def free_matrices(self) -> None:
        """Free the matrices of the model, 50 MB for a VHGP of 1000 rows, if it predicts from a table."""
        predictor = self.model.predictor.base
        if self.domain is not None and isinstance(predictor, GaussianProcessPredictor):
            predictor.free_matrices()

    def exact_count(self, inputs: Array) -> int:
        """Number of the pushes (n, 3) that are predicted by the model itself, not from a table."""
        return len(inputs) if self.domain is None else int(np.sum(~self.domain.covered(inputs)))

    @cached_property
    def _exact(self) -> PushModel:
        """The same model, which computes the mechanics and effects of single pushes in plain numbers."""
        return replace(self.model, predictor=self.model.predictor.with_scalar_mechanics())

    @cached_property
    def _residual(self) -> PushModel:
        """The model of what is tabulated, in place of the base."""
        return of_targets(self.model.base)

    @cached_property
    def _factor(self) -> Array:
        """Factor (3, 3) on the base's covariances."""
        assert self.effects is not None
        return np.outer(self.effects.source.predictor.scale, self.effects.source.predictor.scale)

    @cached_property
    def _noise(self) -> Array | None:
        """The covariance (3, 3) that the mechanics below effects add to all pushes; None for other bases."""
        base = self.model.predictor.base
        return base.covariance * self._factor if isinstance(base, MECHANICS) else None

    @cached_property
    def _box(self) -> FeatureBox:
        return feature_box(self.model)

    def _in_domain(self, inputs: Array) -> BoolArray:
        if len(inputs) > 1:
            return self.model.in_domain(inputs)
        return np.array([self._box.contains(inputs[0].tolist())])

    @cached_property
    def _single_effects(self) -> SingleEffects:
        assert self.effects is not None
        return SingleEffects(self.effects)

    def _added(self, push: Push) -> Prediction:
        """What a base other than mechanics adds to a table of effects: all but the displacement of its mechanics."""
        predictor = self.model.predictor.base
        if self.domain is None:
            learnt = self._residual.predict_rows(push.inputs, push.duration, push.covariates)
        else:
            learnt = self._learnt(self.domain, push.inputs, push.duration)
        if not isinstance(predictor, GaussianProcessPredictor):
            return learnt
        return Prediction(*predictor.scaled(_moments(learnt), push), learnt.in_domain)

    def _of_base(self, learnt: Prediction, push: Push) -> Prediction:
        """Predictions of the base from those of what it has learnt."""
        predictor = self._exact.predictor.base
        if not isinstance(predictor, GaussianProcessPredictor):
            return learnt
        return Prediction(*predictor.of_outcomes(_moments(learnt), push), learnt.in_domain)

    def _learnt(self, domain: TabulatedDomain, inputs: Array, duration: Array) -> Prediction:
        """Predictions of what the base has learnt, from the table where it can."""
        if len(inputs) == 1:  # in plain numbers, five times as fast
            return domain.predict_one(inputs[0].tolist()) or self._residual.predict_rows(inputs, duration)
        covered, prediction = domain.predict(inputs)
        if prediction is not None:
            return prediction
        beyond = self._residual.predict_rows(inputs[~covered], duration[~covered])
        if not covered.any():
            return beyond
        return _merged(covered, self._learnt(domain, inputs[covered], duration[covered]), beyond)


def tabulate(model: PushModel) -> TabulatedModel:
    """The model with a table if it can have one; takes about a second for a VHGP of 1000 rows."""
    learnt = of_targets(model.base)
    if isinstance(learnt.predictor, PriorPredictor):
        table, how = tabulated_prior(learnt.predictor)
        return TabulatedModel(model if table is None else with_base(model, table), how)
    if not isinstance(learnt.predictor, GaussianProcessPredictor):
        return TabulatedModel(model, ONLY_LEARNT)
    exact, posteriors = probed(learnt), [on_grid(regression) for regression in learnt.predictor.regressions]
    why = ""
    for ends in (wide_box(model), narrow_box(model)):
        found = _accurate(learnt, learnt.predictor, posteriors, ends, exact)
        if not isinstance(found, str):
            return with_domain(model, *found)
        why = found
    return TabulatedModel(model, f"exact: {why}")


def _accurate(
    learnt: PushModel,
    predictor: GaussianProcessPredictor,
    posteriors: Sequence[OnGrid],
    ends: tuple[Array, Array],
    exact: Probes,
) -> tuple[TabulatedDomain, TableAccuracy] | str:
    """The coarsest table between these ends that is accurate, and its errors; else why there is none."""
    how = ""
    for refinement in REFINEMENTS:
        try:
            domain = tabulated_domain(learnt, predictor, posteriors, ends, refinement)
        except TooFineError as too_fine:
            return f"{how}{too_fine}"
        error = exact.error_of(domain)
        if error.accepted:
            return domain, error
        how = f"a table gives {error}; "
    return f"{how}too far off"


def with_domain(model: PushModel, domain: TabulatedDomain, error: TableAccuracy) -> TabulatedModel:
    """The model with a table that was compared with it."""
    return TabulatedModel(model, f"table of {domain.table.knots} knots, {error}", domain, error)


def with_effect_table(tabulated: TabulatedModel) -> TabulatedModel:
    """The same with a table of its effects, if it has effects and the table is accurate; takes some seconds."""
    if not tabulated.model.predictor.effects:
        return tabulated
    return with_effects(tabulated, *build_effect_table(tabulated.model))


def with_effects(tabulated: TabulatedModel, table: EffectTable | None, how: str) -> TabulatedModel:
    """The same with this table of its effects, None if they are computed; how: in words."""
    return replace(tabulated, effects=table, effects_how=how)


def with_base(model: PushModel, base: PriorPredictor) -> PushModel:
    """The model with this base, below its effects if it has any."""
    predictor = model.predictor.with_base(base) if model.predictor.effects else base
    return replace(model, predictor=predictor)


def of_targets(model: PushModel) -> PushModel:
    """The model of what is tabulated: what was learnt, at one path length and without the mechanics."""
    predictor = model.predictor
    if not isinstance(predictor, GaussianProcessPredictor):
        return model
    return replace(model, predictor=predictor.of_targets())


def _moments(prediction: Prediction) -> Moments:
    return Moments(prediction.mean, prediction.covariance, prediction.process_covariance)


def _merged(chosen: BoolArray, one: Prediction, other: Prediction) -> Prediction:
    """Row by row from `one` where chosen (n,), else from `other`."""
    parts: list[Any] = []
    for name in ("mean", "covariance", "process_covariance", "in_domain"):
        first, second = getattr(one, name), getattr(other, name)
        part = np.empty((len(chosen), *first.shape[1:]), first.dtype)
        part[chosen], part[~chosen] = first, second
        parts.append(part)
    mean, covariance, process_covariance, in_domain = parts
    return Prediction(mean, covariance, process_covariance, in_domain)
