# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A VHGP of many rows, represented by the posterior of f and g at inducing inputs, and its fit.

The cost of a prediction depends on the number of inducing inputs, not of rows. The fit is coarse to fine: a dense VHGP
of few rows, then the sparse bound of more rows, then of all. Each stage chooses the inducing inputs by the
hyperparameters of the stage before and keeps them.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from push_predictor.errors import TrainingError
from push_predictor.models.gaussian_process.bound import Bound, VhgpParameters, VhgpProblem
from push_predictor.models.gaussian_process.fit import (
    FEW_ROWS,
    LOG_NUGGET_SD,
    NOISE_LENGTHSCALE,
    NOISE_LENGTHSCALE_SPREAD,
    NOISE_LOG_SD,
    SPREAD,
    Prior,
    Search,
)
from push_predictor.models.gaussian_process.gp import NEAR, Descent, check_rows, some_rows
from push_predictor.models.gaussian_process.inducing import InducedKernel, inducing_rows
from push_predictor.models.gaussian_process.prediction import LatentPrediction
from push_predictor.models.gaussian_process.vhgp import VHGP, fit_vhgp
from push_predictor.types import Array, IntArray

DEFAULT_INDUCING = 100

_DENSE_ROWS = 500
_MIDDLE_ROWS = 5000
_MOST_ITERATIONS = 20
_SEARCH_TOLERANCE, _FINAL_TOLERANCE, _STOP = 4e-6, 1e-7, 1e-5  # nats a row
_REACH = np.log(30.0)  # by this factor a hyperparameter may change in a stage


class SparseVHGP(VHGP):
    """A sparse VHGP conditioned on inputs (n, D) and outputs (n,), both standardised by the caller.

    site_precisions (n,) is Lambda of bound.py; inducing_signal and inducing_noise: which of the rows are inducing
    inputs of f and of g. Only the posteriors at these are kept.
    """

    def __init__(
        self,
        inputs: Array,
        outputs: Array,
        parameters: VhgpParameters,
        site_precisions: Array,
        inducing_signal: IntArray,
        inducing_noise: IntArray,
    ) -> None:
        super().__init__(inputs, outputs, parameters, site_precisions)
        self.inducing_signal, self.inducing_noise = inducing_signal, inducing_noise
        _ = self.functions
        self.free_matrices()

    @cached_property
    def solved(self) -> Bound:
        """The bound, with (n, m) matrices."""
        chosen = self.inputs[self.inducing_signal], self.inputs[self.inducing_noise]
        return Bound.tied(problem_about(self.inputs, self.outputs, self.parameters, *chosen), self.site_precisions)

    def free_matrices(self) -> None:
        """See VHGP; the posteriors stay."""
        self.__dict__.pop("solved", None)

    def _predicted_without(self, block: IntArray) -> LatentPrediction:
        prediction = super()._predicted_without(block)
        self.free_matrices()
        return prediction


def fit_sparse_vhgp(inputs: Array, outputs: Array, most_inducing: int = DEFAULT_INDUCING) -> SparseVHGP:
    """Maximise the sparse bound over hyperparameters and q(g).

    inputs (n, D) and outputs (n,) standardised; most_inducing: of f, and of g. The same rows give the same model.
    Raises TrainingError when the rows do not match, are not finite, or the bound is not finite anywhere.
    """
    check_rows(inputs, outputs)
    few, more = some_rows(len(outputs), _DENSE_ROWS), some_rows(len(outputs), _MIDDLE_ROWS)
    coarse = fit_vhgp(inputs[few], outputs[few], rough=True)
    return _refined(_refined(coarse, inputs[more], outputs[more], most_inducing), inputs, outputs, most_inducing)


def _refined(rough: VHGP, inputs: Array, outputs: Array, most_inducing: int) -> SparseVHGP:
    """The model of these rows, starting from a model of some of them."""
    n, first = len(outputs), rough.parameters.to_vector()
    chosen = [inducing_rows(k, inputs, most_inducing) for k in (rough.parameters.signal, rough.parameters.noise)]
    places = [inputs[rows] for rows in chosen]
    prior, tolerance = noise_prior(inputs.shape[1], n), _SEARCH_TOLERANCE * n
    search = Search(lambda p: problem_about(inputs, outputs, p, *places), prior, tolerance)
    box = np.column_stack([first - _REACH, first + _REACH])
    box[-2, 1] = np.inf  # one open side, see gp.py
    Descent(box, _MOST_ITERATIONS, _STOP).run(search.cost, first, NEAR)
    try:
        return SparseVHGP(inputs, outputs, *search.solved(_FINAL_TOLERANCE * n), *chosen)
    except (np.linalg.LinAlgError, FloatingPointError) as error:
        raise TrainingError(f"no sparse VHGP of {n} rows was found: {error}") from None


def problem_about(
    inputs: Array, outputs: Array, parameters: VhgpParameters, of_signal: Array, of_noise: Array
) -> VhgpProblem:
    """With these inducing inputs (m, D) of f and of g."""
    signal = InducedKernel.of(parameters.signal, inputs, of_signal)
    noise = InducedKernel.of(parameters.noise, inputs, of_noise)
    return VhgpProblem(outputs, parameters, signal, noise)


def noise_prior(d: int, n: int) -> Prior:
    """Of g's hyperparameters: that of a dense fit; but its lengthscales' and its sd's for n rows as for a hundred."""
    centre, spread = np.zeros(2 * d + 4), np.full(2 * d + 4, np.inf)
    centre[d + 1 : -2] = [NOISE_LENGTHSCALE] * d + [NOISE_LOG_SD]
    spread[d + 1 : -2] = np.sqrt(FEW_ROWS / n) * np.array([NOISE_LENGTHSCALE_SPREAD] * d + [SPREAD])
    centre[-1], spread[-1] = LOG_NUGGET_SD, SPREAD
    return Prior(centre, spread)
