# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The batch of pushes that a model learns most from.

Greedy selection by what each push would add to the model's knowledge (information.py). Where the criterion
is no better than that, pushes are spread evenly: those up to the tenth of a learnt model without mechanics, whose
hyperparameters are not yet known well enough to choose by; and those from the sixth on of a prior model, whose
mechanics are known by then but for what they cannot express.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.blas_threads import one_blas_thread
from push_predictor.design.candidates import Courses, candidate_pushes, courses
from push_predictor.design.features import features_of
from push_predictor.design.information import Information, greedy
from push_predictor.design.limits import Limits
from push_predictor.errors import RequestError
from push_predictor.models.mechanics.prior import CORRELATION
from push_predictor.models.predictors import GaussianProcessPredictor, PriorPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push, Pushes
from push_predictor.models.request import check_requests
from push_predictor.planning.persistence import Persistence, persistence_of
from push_predictor.types import Array
from push_predictor.watch import Watch, no_watch, part_of

CANDIDATES, MATTER = 256, 128  # pushes
BEFORE_CHOICE = 0.6  # share of the time, for 20 pushes
MOST_PUSHES = 200  # half a minute; later pushes should wait for the outcomes of the first
FIRST = 10  # pushes of a learnt model that are spread evenly; benchmarks/models/RESULTS.md compares this start
CHOSEN_OF_PRIOR = 5  # pushes; docs/results/prior.md has those of a prior model


@dataclass(frozen=True, eq=False)
class Suggested:
    """k pushes in the order in which to make them.

    inputs (k, 3: velocity m/s, contact, angle rad) at first touch; duration (k,) of each whole push, s; variance_left
    (k,): expected share of the mean function's variance, over the pushes that matter and in units of noise, that is
    left after each.
    """

    inputs: Array
    duration: Array
    variance_left: Array

    def __len__(self) -> int:
        return len(self.inputs)


@one_blas_thread()
def suggest_pushes(
    model: PushModel,
    count: int,
    limits: Limits = Limits(),
    *,
    matter: Pushes | None = None,
    covariates: Mapping[str, float] | None = None,
    seed: int = 0,
    check_cancelled: Callable[[], None] | None = None,
    watch: Watch = no_watch,
) -> Suggested:
    """The pushes that a model would learn most from: those that most reduce what its uncertain mean function costs.

    The cost is in log predictive density: the process noise, which no push reduces, is no part of it. It is the mean
    over the pushes that matter: `matter`, or by default all that the robot can make, evenly. Then the first ten pushes
    of a learnt model without mechanics and all but the first five of a prior model, those that it was trained on
    included, are spread evenly. covariates: of all pushes, as an extended model needs them. seed: of the candidates.
    check_cancelled is called before each push and may raise. watch: called with the share of the work done.
    Raises RequestError that names the field.
    """
    if not 1 <= count <= MOST_PUSHES:
        raise RequestError("count", count, f"an integer from 1 to {MOST_PUSHES}")
    if check_cancelled is not None:
        check_cancelled()
    inputs = candidate_pushes(model, limits, CANDIDATES, seed)
    relevant = _matter(model, limits, seed) if matter is None else Push(matter.inputs, matter.duration, {})
    watch("candidates", 0.0)
    tried = courses(model, inputs, limits.travel)
    found = information_of(model, tried, relevant, covariates or {})
    before = found.variance
    evenly = _spread_evenly(model, count) if matter is None else [None] * count
    order, variances = greedy(
        found, count, evenly, _per_second(model, inputs, limits), check_cancelled, part_of(watch, BEFORE_CHOICE, 1.0)
    )
    return Suggested(inputs[order], limits.travel / inputs[order, 0], variances / before)


def information_of(
    model: PushModel, tried: Courses, matter: Push, covariates: Mapping[str, float] | None = None
) -> Information:
    """What candidates would tell a model about the pushes that matter. Raises RequestError for a missing covariate."""
    windows, count = tried.windows, len(tried.inputs)
    inputs = np.concatenate([windows.inputs, matter.inputs])
    both = Push(inputs, np.concatenate([windows.duration, matter.duration]), {})
    values = features_of(model, _with_covariates(model, both, covariates or {})).values
    q, cut = values.shape[2], len(windows.inputs)
    candidates = values[:cut].reshape(count, -1, 3, q) * tried.kept[:, :, None, None]
    return Information(candidates.reshape(count, -1, q), _noise(model, tried), values[cut:].reshape(-1, q))


def _spread_evenly(model: PushModel, count: int) -> list[int | None]:
    """The next `count` candidates, which follow a Sobol' sequence; None for those that are to be chosen."""
    base, known = model.predictor.base, len(model.training.pushes)
    places = range(known, known + count)
    if isinstance(base, PriorPredictor):
        return [place % CANDIDATES if place >= CHOSEN_OF_PRIOR else None for place in places]
    if isinstance(base, GaussianProcessPredictor) and base.mean is None:
        return [place if place < FIRST else None for place in places]
    return [None] * count


def _matter(model: PushModel, limits: Limits, seed: int) -> Push:
    """Windows evenly over what the robot can do, others than the candidates."""
    inputs = candidate_pushes(model, limits, MATTER, seed + 1)
    return Push(inputs, np.full(len(inputs), model.usual_duration), {})


def _with_covariates(model: PushModel, push: Push, given: Mapping[str, float]) -> Push:
    """The same covariates for all pushes. Raises RequestError for a push that the model cannot predict."""
    covariates = {name: np.full(len(push.inputs), given[name]) for name in model.accepted if name in given}
    check_requests(model, push.inputs, push.duration, covariates)
    return Push(push.inputs, push.duration, covariates)


def _noise(model: PushModel, tried: Courses) -> Array:
    """Covariance (c, 3 w, 3 w) of the outcomes of each candidate given the mean function, in units of their noise.

    The windows of a push share a part of their error, so that more windows of one push tell little.
    """
    count, w = tried.kept.shape
    both = tried.kept[:, :, None] & tried.kept[:, None]
    correlation = _persistence(model).correlation(tried.distance.ravel()).reshape(count, w, w, 3)
    correlation = np.where(both[..., None], correlation, 0.0)
    correlation[:, np.arange(w), np.arange(w)] = 1.0
    noise = np.zeros((count, w, 3, w, 3))
    for k in range(3):
        noise[:, :, k, :, k] = correlation[..., k]
    return noise.reshape(count, 3 * w, 3 * w)


def _persistence(model: PushModel) -> Persistence:
    """Of errors along a push; for a prior model that with which it takes in further pushes."""
    if isinstance(model.predictor.base, PriorPredictor):
        return Persistence(np.full(3, CORRELATION), np.zeros(3), np.ones(3))
    return persistence_of(model)


def _per_second(model: PushModel, inputs: Array, limits: Limits) -> Callable[[Sequence[int]], Array] | None:
    """One over the time (c,) of each push after those chosen: its own, and that of the tip around the outline to it."""
    if limits.transfer_speed is None:
        return None
    own, contact, perimeter = limits.travel / inputs[:, 0], inputs[:, 1], model.rig.outline.perimeter
    speed = limits.transfer_speed

    def per_second(chosen: Sequence[int]) -> Array:
        if not len(chosen):
            return np.asarray(1.0 / own)
        away = np.abs(contact - contact[chosen[-1]])
        return np.asarray(1.0 / (own + np.minimum(away, 1.0 - away) * perimeter / speed))

    return per_second
