# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The scores of a joint fit are those of blocks of pushes that the coefficients were not fitted to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_traces import DRIFT, planted, pushes, slippery
from scipy.stats import multivariate_t
from synthetic import square_rig

from push_predictor.models.push_model import PushModel
from push_predictor.models.train import train_model
from push_predictor.residuals.candidates.candidate import candidate
from push_predictor.residuals.candidates.joint_fit import DEGREES, FOLDS, RIDGE, Fit, FitRows, fitted, standard_error
from push_predictor.residuals.evidence.residualizer import sums_by
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of


@pytest.fixture(scope="module")
def deployed() -> PushModel:
    return train_model(pushes(60, 1), square_rig(), "analytical", name="deployed")


def fit_of(evidence: Evidence, *mechanisms: str | None) -> Fit:
    """The fit of effects along the elapsed time."""
    return fitted(FitRows(evidence), [candidate(evidence, name, "elapsed_time", DRIFT) for name in mechanisms])


def refitted_scores(fit: Fit) -> np.ndarray:
    """Score of each block by a fit of a generic effect from the beginning to the rows of the other folds."""
    evidence, share, root = fit.rows.evidence, fit.rows.share, fit.weighted.root
    flat, target = root[:, :, None] * fit.columns, root * evidence.z
    ridge = np.diag(RIDGE * np.sum(flat**2, axis=(0, 1)) + 1.0)  # a normal prior of its unit besides
    left = np.zeros_like(target)
    for fold in range(FOLDS):
        out = fit.rows.block % FOLDS == fold
        x, y = flat[~out].reshape(-1, flat.shape[2]), target[~out].ravel()
        left[out] = evidence.z[out] - fit.columns[out] @ np.linalg.solve(x.T @ x + ridge, x.T @ y)
    unit = np.sqrt(np.average(left**2 * (fit.weighted.weight / share)[:, None], axis=0, weights=share))
    density = multivariate_t(np.zeros(3), np.diag(unit**2), DEGREES)
    constant = multivariate_t(np.zeros(3), np.eye(3), DEGREES).logpdf(np.zeros(3))
    return sums_by(fit.rows.block, (share * (density.logpdf(left) - constant))[:, None])[:, 0]


def test_scores_are_those_of_a_refit_without_each_fold(deployed: PushModel) -> None:
    unknown = planted(None, "elapsed_time", DRIFT, *np.linspace(-1.0, 1.0, 18))
    evidence = evidence_of(deployed, pushes(60, 2))
    design = candidate(evidence, None, "elapsed_time", DRIFT).plain
    moved = np.linalg.solve(evidence.whitener, (design @ unknown.coefficients)[:, :, None])[:, :, 0]
    fit = fit_of(replace(evidence, residual=evidence.residual + moved), None)
    np.testing.assert_allclose(fit.scores, refitted_scores(fit), rtol=1e-3, atol=1e-3)
    assert len(fit.scores) == 60


def test_scores_of_an_exact_effect_are_those_of_a_refit_without_each_fold(deployed: PushModel) -> None:
    """One Gauss-Newton step from the fit of all is near the exact fit without a fold."""
    evidence = evidence_of(deployed, pushes(60, 2, slippery(0.1)))
    fit = fit_of(evidence, "contact_friction")
    left = evidence.z - fit.shift
    for fold in range(FOLDS):
        out = fit.rows.block % FOLDS == fold
        again = fit_of(evidence.take(~out), "contact_friction")
        whole = fitted(FitRows(evidence), [candidate(evidence, "contact_friction", "elapsed_time", DRIFT)])
        change = again.coefficients - whole.coefficients
        left[out] -= (fit.columns @ change)[out]
    share = fit.rows.share
    unit = np.sqrt(np.average(left**2 * (fit.weighted.weight / share)[:, None], axis=0, weights=share))
    expected = -0.5 * (DEGREES + 3.0) * np.log1p(np.sum((left / unit) ** 2, axis=1) / DEGREES) - np.log(unit).sum()
    assert fit.scores.sum() == pytest.approx(float(share @ expected), abs=0.3)


@pytest.mark.parametrize("covariate", ["elapsed_time", "slider_x"])
def test_gain_to_first_order_is_that_of_a_fit_with_the_columns(deployed: PushModel, covariate: str) -> None:
    """Of a small effect of either sort, next to another."""
    evidence = evidence_of(deployed, pushes(100, 2, slippery(0.05)))
    base = fit_of(evidence, "pressure_spread")
    basis = replace(
        DRIFT, drivers=(covariate,), centre=(0.0,), scale=(float(evidence.table.covariates[covariate].std()),)
    )
    for mechanism in (None, "contact_friction"):
        more = candidate(evidence, mechanism, covariate, basis)
        both = fitted(FitRows(evidence), [candidate(evidence, "pressure_spread", "elapsed_time", DRIFT), more])
        expected = float((both.scores - base.scores).sum())
        assert float((base.with_columns(more.plain) - base.scores).sum()) == pytest.approx(expected, rel=0.15, abs=3.0)


def test_an_effect_that_acts_gains_and_one_that_does_not_loses(deployed: PushModel) -> None:
    """Eighteen coefficients fit the noise of any pushes, but not that of others."""
    acting, idle = [], []
    for seed in range(2, 8):
        for found, table in ((acting, pushes(60, seed, slippery(0.1))), (idle, pushes(60, seed))):
            evidence = evidence_of(deployed, table)
            found.append(float((fit_of(evidence, None).scores - fit_of(evidence).scores).sum()))
    assert min(acting) > 20.0
    assert np.mean(idle) < 0.0


def test_scores_do_not_depend_on_the_unit_of_an_output(deployed: PushModel) -> None:
    """Up to a constant that all fits share."""
    evidence = evidence_of(deployed, pushes(60, 2, slippery(0.1)))
    louder = replace(evidence, whitener=np.diag([1.0, 3.0, 0.5]) @ evidence.whitener)
    gains = [fit_of(e, "contact_friction").scores.sum() - fit_of(e).scores.sum() for e in (evidence, louder)]
    assert gains[0] == pytest.approx(gains[1], rel=1e-3)


def test_standard_error_is_that_of_a_sum_of_independent_blocks() -> None:
    sums = np.random.default_rng(0).normal(0.3, 2.0, (400, 50)).sum(axis=1)
    gains = np.random.default_rng(1).normal(0.3, 2.0, 5000)
    assert standard_error(gains) == pytest.approx(10.0 * sums.std(), rel=0.1)
