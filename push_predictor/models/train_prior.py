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

"""Training a prior model: outline and priors alone, or with as many pushes as there are."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from push_predictor.models.mechanics.fit import FitRows
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameter_draws import drawn_parameters, normal_draws, prior_draws, prior_spreads
from push_predictor.models.mechanics.parameter_update import updated
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.process_noise import ProcessNoise
from push_predictor.models.predictors import PriorPredictor
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array


def prior_predictor(mechanics: PushMechanics, rig: Rig, seed: int = 0) -> PriorPredictor:
    """The predictor before the first push.

    The prior of the contact friction is about the rig's coefficient, where it has one. seed: of the draws.
    """
    names = drawn_parameters(known_support=mechanics.support is not None)
    known = {} if rig.contact_friction is None else {"contact_friction": rig.contact_friction}
    means = {name: known.get(name, BY_NAME[name].textbook) for name in names}
    within = {name: float(np.clip(mean, BY_NAME[name].low, BY_NAME[name].high)) for name, mean in means.items()}
    fitted = FittedMechanics(mechanics, within, np.diag(prior_spreads(names) ** 2))
    return PriorPredictor(fitted, prior_draws(names, _values(within), seed), ProcessNoise())


def sharpened(before: PriorPredictor, rows: PushTable, seed: int = 0) -> PriorPredictor:
    """The predictor `before` the first push, updated by the pushes of a table with any number of rows."""
    if not len(rows):
        return before
    mechanics, names = before.fitted.mechanics, tuple(before.fitted.values)
    push = np.unique(rows.push_id, return_inverse=True)[1]
    fit_rows = FitRows(rows.inputs, rows.duration, rows.outcomes, push, rows.covariates)
    found = updated(mechanics, names, _values(before.fitted.values), fit_rows, before.fitted.ellipsoid.length)
    values = dict(zip(names, found.values.tolist(), strict=True))
    draws = normal_draws(names, found.values, found.covariance, seed)
    return PriorPredictor(FittedMechanics(mechanics, values, found.covariance), draws, found.noise)


def _values(values: Mapping[str, float]) -> Array:
    return np.array(list(values.values()))
