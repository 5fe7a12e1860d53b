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

"""In words, what the mean of a model is."""

from __future__ import annotations

from push_predictor.models.predictors import GaussianProcessPredictor, MechanicsPredictor, Predictor, PriorPredictor


def mean_of(predictor: Predictor) -> str:
    """What the base of a predictor predicts with before it has learnt anything."""
    base = predictor.base
    if isinstance(base, GaussianProcessPredictor):
        per_path = "" if base.scaling.travel is not None else ", not per path length"
        return ("zero" if base.mean is None else "fitted mechanics") + per_path
    if _is_textbook(predictor):
        return "textbook mechanics"
    return "mechanics with uncertain parameters" if isinstance(base, PriorPredictor) else "fitted mechanics"


def mean_parameters(predictor: Predictor) -> dict[str, float]:
    """The parameters of these mechanics by name, in the units of PARAMETERS; empty for the textbook's, and for none."""
    base = predictor.base
    if _is_textbook(predictor) or (isinstance(base, GaussianProcessPredictor) and base.mean is None):
        return {}
    return {name: float(value) for name, value in base.mechanics.values.items()}


def _is_textbook(predictor: Predictor) -> bool:
    base = predictor.base
    return isinstance(base, MechanicsPredictor) and not base.fitted.covariance.any()


def mean_in_words(predictor: Predictor) -> str:
    """Both on one line."""
    values = ", ".join(f"{name} {value:.3g}" for name, value in mean_parameters(predictor).items())
    return f"{mean_of(predictor)} ({values})" if values else mean_of(predictor)
