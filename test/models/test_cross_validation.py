# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Leave-block-out predictions in closed form, against regressions that never had the block."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drifting_models import extended, pushes, slippery
from synthetic import noisy_pushes, square_rig

from push_predictor.models.gaussian_process.bound import VhgpProblem
from push_predictor.models.gaussian_process.fit import maximise_over_noise
from push_predictor.models.gaussian_process.gp import GaussianProcess, fit_gp
from push_predictor.models.gaussian_process.vhgp import VHGP, fit_vhgp
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.pushes import Push
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.types import Array, IntArray

BLOCKS = 6
TO = 1e-2  # nats, to which the noise of the remaining rows is solved for
FIELDS = ("mean", "variance", "log_noise_mean", "log_noise_variance")


def rows(n: int, seed: int = 0) -> tuple[Array, Array, IntArray]:
    """Inputs, outputs whose noise grows along the first input, blocks of rows side by side."""
    rng = np.random.default_rng(seed)
    inputs = rng.standard_normal((n, 2))
    noise = np.exp(-1.5 + 0.8 * inputs[:, 0]) * rng.standard_normal(n)
    return inputs, np.sin(inputs[:, 0]) + 0.5 * inputs[:, 1] + noise, np.arange(n) // 5 % BLOCKS


def conditioned(regression: GaussianProcess | VHGP, inputs: Array, outputs: Array) -> GaussianProcess | VHGP:
    """A regression's hyperparameters on other rows; the noise process of a VHGP is solved for on them.

    Site precisions of other rows do not do: the noise's mean is a sum over all rows that nearly cancel.
    """
    if isinstance(regression, GaussianProcess):
        return GaussianProcess(inputs, outputs, regression.parameters)
    parameters = regression.parameters
    bound = maximise_over_noise(VhgpProblem.of(inputs, outputs, parameters), None, TO)
    return VHGP(inputs, outputs, parameters, bound.tied_precisions)


def refitted(regression: GaussianProcess | VHGP, block: IntArray) -> dict[str, Array]:
    """The same, from regressions that are solved again on the rows of the other blocks."""
    found = {name: np.empty(len(block)) for name in FIELDS}
    for number in range(BLOCKS):
        out = block == number
        without = conditioned(regression, regression.inputs[~out], regression.outputs[~out])
        prediction = without.predict(regression.inputs[out])
        for name in FIELDS:
            found[name][out] = getattr(prediction, name)
    return found


def test_held_out_gp_equals_gp_conditioned_on_other_blocks() -> None:
    inputs, outputs, block = rows(120)
    regression = fit_gp(inputs, outputs)
    found, expected = regression.held_out(block), refitted(regression, block)
    for name in FIELDS:
        np.testing.assert_allclose(getattr(found, name), expected[name], rtol=1e-5, atol=1e-8)


@pytest.mark.slow
def test_held_out_vhgp_is_close_to_vhgp_solved_on_other_blocks() -> None:
    inputs, outputs, block = rows(220)
    regression = fit_vhgp(inputs, outputs, most_iterations=15)
    found, expected = regression.held_out(block), refitted(regression, block)
    sd = np.sqrt(expected["variance"] + np.exp(expected["log_noise_mean"]))
    own = regression.predict(inputs)
    for name, unit, most in (("mean", sd, 0.05), ("log_noise_mean", 1.0, 0.1)):
        error = np.sqrt(np.mean(((getattr(found, name) - expected[name]) / unit) ** 2))
        unaware = np.sqrt(np.mean(((getattr(own, name) - expected[name]) / unit) ** 2))
        assert error < most and error < 0.5 * unaware, (name, error, unaware)
    for name in ("variance", "log_noise_variance"):
        ratio = getattr(found, name) / expected[name]
        assert np.mean((ratio > 0.7) & (ratio < 1.4)) > 0.95, name


def test_held_out_moments_of_predictor_are_those_of_its_regressions_in_si_units() -> None:
    table = noisy_pushes(80, windows_per_push=4)
    model = train_model(table, square_rig(), "gp", name="gp", options=TrainingOptions(mean="zero"))
    predictor = model.predictor.with_independent_outputs()
    assert isinstance(predictor, GaussianProcessPredictor)
    block = np.arange(80) // 4 % BLOCKS
    found = predictor.held_out_moments(Push.of(table), block)
    for number in range(BLOCKS):
        out = block == number
        without = tuple(conditioned(r, r.inputs[~out], r.outputs[~out]) for r in predictor.regressions)
        moments = replace(predictor, regressions=without).moments(Push.of(table.take(out)))
        for whole, part in zip(found, moments, strict=True):
            np.testing.assert_allclose(whole[out], part, rtol=1e-6, atol=1e-12)


def test_held_out_moments_of_extended_model_include_its_effects() -> None:
    base = train_model(pushes(20), square_rig(), "gp", name="gp", options=TrainingOptions(mean="zero"))
    model, rows = extended(base, slippery(0.2, 0.05)), base.training
    shift = model.predictor.shift(Push.of(rows))
    found, plain = model.held_out_moments(), base.held_out_moments()
    np.testing.assert_allclose(found.mean, plain.mean + shift.mean)
    np.testing.assert_allclose(found.covariance, plain.covariance + shift.covariance)
