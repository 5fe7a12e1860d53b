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

"""What is computed once for many candidates is what each alone would get."""

from __future__ import annotations

import numpy as np
import pytest
from made_up_traces import pushes
from synthetic import square_rig

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import train_model
from push_predictor.residuals.candidates.candidate import candidate
from push_predictor.residuals.candidates.nuisance import Nuisance
from push_predictor.residuals.evidence.drivers import standard_basis
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.residualizer import sums_by
from push_predictor.residuals.evidence.standardised import evidence_of, whitened_response
from push_predictor.residuals.selection.baseline import baseline_of
from push_predictor.residuals.selection.cross_validation import FOLDS, fit, gains_of


@pytest.fixture(scope="module")
def deployed() -> PushModel:
    return train_model(pushes(60, 1), square_rig(), "analytical", name="deployed")


def fold_by_fold(residual: np.ndarray, flat: np.ndarray, block: np.ndarray) -> np.ndarray:
    """The gain of every block by a fit to the rows of all other folds."""
    gains = np.zeros(len(residual))
    for fold in range(FOLDS):
        test = block % FOLDS == fold
        if not test.any() or test.all():
            continue
        after = residual - flat @ fit(flat[~test], residual[~test], block[~test])
        old, new = (np.mean(r[~test] ** 2, axis=0) for r in (residual, after))
        for r, variance, sign in ((after, new, 1.0), (residual, old, -1.0)):
            gains[test] -= sign * 0.5 * np.sum(np.log(variance) + r[test] ** 2 / variance, axis=1)
    return np.array([gains[block == b].sum() for b in np.unique(block)])


@pytest.mark.parametrize("blocks", [1, 3, 23])  # one fold, fewer than all, uneven ones
def test_gains_are_those_of_a_fit_without_each_fold(blocks: int) -> None:
    rng = np.random.default_rng(blocks)
    block = np.sort(rng.integers(blocks, size=90)) + 2
    flat = rng.normal(size=(90, 3, 4)) * [1.0, 10.0, 0.1, 1.0]
    residual = rng.normal(size=(90, 3)) * [1.0, 2.0, 0.5] + 0.3 * flat[:, :, 0]
    gains = gains_of(residual, flat, block)
    np.testing.assert_allclose(gains, fold_by_fold(residual, flat, block), atol=1e-9)
    assert len(gains) == len(np.unique(block))


def test_sums_by_block_follow_the_blocks_numbers_in_any_order_of_rows() -> None:
    block, values = np.array([7, 2, 7, 5, 2]), np.arange(10.0).reshape(5, 2)
    np.testing.assert_array_equal(sums_by(block, values), [[10.0, 12.0], [6.0, 7.0], [4.0, 6.0]])


def test_scores_in_training_do_not_depend_on_what_was_scored_before(deployed: PushModel) -> None:
    evidence = evidence_of(deployed, pushes(40, 2))
    drift = standard_basis("linear", "elapsed_time", evidence.table.covariates["elapsed_time"])
    tried = [
        candidate(evidence, mechanism, covariate, basis)
        for mechanism in ("contact_friction", "pusher_travel")
        for covariate, basis in (("elapsed_time", drift), ("elapsed_time", DriverBasis("constant")))
    ]
    after_others = baseline_of(deployed, evidence.mechanics)
    for one in tried:
        found, information = after_others.scores(one)
        alone, expected = baseline_of(deployed, evidence.mechanics).scores(one)
        np.testing.assert_allclose(found.rows, alone.rows, atol=1e-12 * np.abs(alone.rows).max())
        np.testing.assert_allclose(information, expected, atol=1e-12 * np.abs(expected).max())


def test_nuisance_columns_are_orthonormal_and_span_the_constant_effects(deployed: PushModel) -> None:
    evidence = evidence_of(deployed, pushes(60, 3))
    names = ["contact_friction", "pusher_travel", "centre_of_friction"]
    responses = {name: whitened_response(evidence, name) for name in names}
    inputs = inputs_basis(deployed, evidence.table)
    nuisance = Nuisance(evidence, inputs, names, responses.__getitem__)
    columns = nuisance.of_growth("pusher_travel", "elapsed_time", "driven")
    assert columns is not None
    np.testing.assert_allclose(columns.T @ columns, np.eye(columns.shape[1]), atol=1e-8)
    q, _ = np.linalg.qr(inputs.columns)
    for name in ("contact_friction", "centre_of_friction"):
        flat = responses[name].reshape(len(q), -1)
        apart = (flat - q @ (q.T @ flat)).reshape(len(columns), -1)
        left = apart - columns @ (columns.T @ apart)
        assert np.linalg.norm(left) < 1e-2 * np.linalg.norm(flat)
