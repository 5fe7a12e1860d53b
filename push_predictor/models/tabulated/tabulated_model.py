"""A push model that predicts from a table, in microseconds, inside the domain of its training data.

A prediction of a learnt model reads six dense factors of n^2 / 2 numbers, but it is a smooth function of at most three
inputs. So it is tabulated once. The table is compared with the model and used only if it is accurate. Every other push
and every other model is predicted by the model itself.

The mechanics have no table, neither alone nor as the mean of a learnt model nor in effects: they have kinks where
contacts begin to slip, and a table would have to be very fine there. A single push is computed in plain numbers
instead. A prior model averages over many parameters, and has a coarse table of its own (tabulated_prior).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from push_predictor.models.mechanisms import Push
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors import GaussianProcessPredictor, Moments, PriorPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.request import PushRequest
from push_predictor.models.tabulated.prediction_table import TooFineError
from push_predictor.models.tabulated.tabulated_domain import TabulatedDomain, tabulated_domain
from push_predictor.models.tabulated.tabulated_prior import tabulated_prior
from push_predictor.types import Array, BoolArray

MEAN_TOLERANCE = 1e-3  # predicted standard deviations, of a push in the domain
COVARIANCE_TOLERANCE = 1e-2  # relative, of the variance of any combination of outputs
CHECKED = 250  # random pushes of the domain, and as many training pushes
REFINEMENTS = (1.0, 1.3, 1.7, 2.2)  # of a table, tried in turn


@dataclass(frozen=True)
class TableAccuracy:
    """The largest differences found between table and model.

    mean: in predicted standard deviations. covariance: relative error of the variance of any combination of outputs,
    which is the largest absolute eigenvalue of L^-1 T L^-T - I, where T is the table's covariance and L L' the model's.
    """

    mean: float
    covariance: float

    @property
    def accepted(self) -> bool:
        """Whether a table with these errors may be used: at half the tolerances, since not every push was compared."""
        return 2.0 * self.mean <= MEAN_TOLERANCE and 2.0 * self.covariance <= COVARIANCE_TOLERANCE

    def __str__(self) -> str:
        return f"means to {self.mean:.1e} standard deviations, covariances to {100.0 * self.covariance:.2g} %"


@dataclass(frozen=True, eq=False)
class TabulatedModel:
    """A model with its table, and in words how it predicts. domain and error are None if there is no table.

    A push gets the same prediction alone as among others, to rounding. Made by `tabulate`.
    """

    model: PushModel
    how: str
    domain: TabulatedDomain | None = None
    error: TableAccuracy | None = None

    @property
    def tabulated(self) -> bool:
        """Whether pushes in the domain are predicted from a table."""
        return self.domain is not None

    def predict_rows(self, inputs: Array, duration: Array, covariates: Mapping[str, Array] | None = None) -> Prediction:
        """Like PushModel.predict; in the domain within the tolerances of this module, elsewhere the same.

        Of an extended model the base is tabulated; the effects are computed and added.
        """
        if self.domain is None:
            return self._exact.predict_rows(inputs, duration, covariates)
        push, predictor = Push(inputs, duration, covariates or {}), self._exact.predictor
        prediction = self._of_base(self._learnt(self.domain, inputs, duration), push)
        if not predictor.effects:
            return prediction
        moments = predictor.with_effects(_moments(prediction), push)
        return Prediction(*moments, prediction.in_domain & self.model.covariates_seen(push))

    def predict_one(self, push: PushRequest) -> Prediction:
        """The same for one push (n = 1)."""
        return self.predict_rows(*push.arrays)

    def exact_count(self, inputs: Array) -> int:
        """Number of the pushes (n, 3) that are predicted by the model itself, not from a table."""
        return len(inputs) if self.domain is None else int(np.sum(~self.model.base.in_domain(inputs)))

    @cached_property
    def _exact(self) -> PushModel:
        """The same model, which computes the mechanics and effects of single pushes in plain numbers."""
        return replace(self.model, predictor=self.model.predictor.with_scalar_mechanics())

    @cached_property
    def _residual(self) -> PushModel:
        """The model of what is tabulated: the base, without the mechanics about which it has learnt residuals."""
        return _without_mean(self.model.base)

    def _of_base(self, learnt: Prediction, push: Push) -> Prediction:
        """Predictions of the base from those of what it has learnt."""
        predictor = self._exact.predictor.base
        if not isinstance(predictor, GaussianProcessPredictor) or predictor.mean is None:
            return learnt
        return Prediction(*predictor.about_mean(_moments(learnt), push), learnt.in_domain)

    def _learnt(self, domain: TabulatedDomain, inputs: Array, duration: Array) -> Prediction:
        """Predictions of what the base has learnt, from the table where it can."""
        if len(inputs) == 1:  # in plain numbers, five times as fast
            return domain.predict_one(inputs[0].tolist()) or self._residual.predict_rows(inputs, duration)
        inside, prediction = domain.predict(inputs)
        if prediction is not None:
            return prediction
        exact = self._residual.predict_rows(inputs[~inside], duration[~inside])
        if not inside.any():
            return exact
        return _merged(inside, self._learnt(domain, inputs[inside], duration[inside]), exact)


def tabulate(model: PushModel) -> TabulatedModel:
    """The model with a table if it can have one; takes about a second for a VHGP of 1000 rows."""
    learnt = _without_mean(model.base)
    if isinstance(learnt.predictor, PriorPredictor):
        table, how = tabulated_prior(learnt.predictor)
        return TabulatedModel(model if table is None else _with_base(model, table), how)
    if not isinstance(learnt.predictor, GaussianProcessPredictor):
        return TabulatedModel(model, "exact: only learnt models have a table")
    how = ""
    for refinement in REFINEMENTS:
        try:
            domain = tabulated_domain(learnt, learnt.predictor, refinement)
        except TooFineError as too_fine:
            return TabulatedModel(model, f"exact: {how}{too_fine}")
        error = _error(learnt, domain)
        if error.accepted:
            return TabulatedModel(model, f"table of {domain.table.knots} knots, {error}", domain, error)
        how = f"a table gives {error}; "
    return TabulatedModel(model, f"exact: {how}too far off")


def _with_base(model: PushModel, base: PriorPredictor) -> PushModel:
    predictor = model.predictor.with_base(base) if model.predictor.effects else base
    return replace(model, predictor=predictor)


def _without_mean(model: PushModel) -> PushModel:
    predictor = model.predictor
    if not isinstance(predictor, GaussianProcessPredictor) or predictor.mean is None:
        return model
    return replace(model, predictor=predictor.without_mean())


def _moments(prediction: Prediction) -> Moments:
    return Moments(prediction.mean, prediction.covariance, prediction.process_covariance)


def _error(model: PushModel, domain: TabulatedDomain) -> TableAccuracy:
    inputs = _probes(model)
    inside, table = domain.predict(inputs)
    assert table is not None, inputs[~inside]
    exact = model.predict_rows(inputs, np.full(len(inputs), model.training.duration[0]))
    sd = np.sqrt(np.diagonal(exact.covariance, axis1=1, axis2=2))
    of_mean = np.max(np.abs(table.mean - exact.mean) / sd)
    of_outcome = relative_error(table.covariance, exact.covariance)
    of_process = relative_error(table.process_covariance, exact.process_covariance)
    return TableAccuracy(float(of_mean), float(max(of_outcome.max(), of_process.max())))


def relative_error(found: Array, exact: Array) -> Array:
    """Largest relative error (n,) of covariances (n, 3, 3) in the variance of any combination of outputs."""
    whitener = np.linalg.inv(np.linalg.cholesky(exact))
    eigenvalues = np.linalg.eigvalsh(whitener @ found @ whitener.transpose(0, 2, 1))
    return np.asarray(np.abs(eigenvalues - 1.0).max(axis=1))


def _probes(model: PushModel) -> Array:
    """Pushes spread evenly over the domain, and training pushes."""
    rng, known = np.random.default_rng(0), model.training.inputs
    low, high = known.min(axis=0), known.max(axis=0)
    low[1], high[1] = 0.0, 1.0
    spread = rng.uniform(low, high, (20 * CHECKED, 3))
    spread = spread[model.in_domain(spread)][:CHECKED]
    return np.concatenate([spread, rng.permutation(known)[:CHECKED]])


def _merged(chosen: BoolArray, one: Prediction, other: Prediction) -> Prediction:
    """Row by row from `one` where chosen (n,), else from `other`."""
    parts = []
    for name in ("mean", "covariance", "process_covariance", "in_domain"):
        first, second = getattr(one, name), getattr(other, name)
        part = np.empty((len(chosen), *first.shape[1:]), first.dtype)
        part[chosen], part[~chosen] = first, second
        parts.append(part)
    return Prediction(*parts)
