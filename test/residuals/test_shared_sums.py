# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What is computed once for many candidates is what each alone would get."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from made_up_traces import pushes
from synthetic import square_rig

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import train_model
from push_predictor.residuals.candidates.candidate import Nuisance, candidate
from push_predictor.residuals.evidence import standardised
from push_predictor.residuals.evidence.drivers import standard_basis
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.residualizer import SINGULAR, Residualizer, sums_by
from push_predictor.residuals.evidence.standardised import evidence_of, whitened_response
from push_predictor.residuals.selection.gate import baseline_of
from push_predictor.residuals.selection.screening import AT_ONCE, Scores, screen


@pytest.fixture(scope="module")
def deployed() -> PushModel:
    return train_model(pushes(60, 1), square_rig(), "analytical", name="deployed")


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
    drift = standard_basis("linear", "elapsed_time", evidence.table.covariates["elapsed_time"])
    columns = nuisance.of_change("pusher_travel", "elapsed_time", drift, "driven")
    assert columns is not None
    np.testing.assert_allclose(columns.T @ columns, np.eye(columns.shape[1]), atol=1e-8)
    q, _ = np.linalg.qr(inputs.columns)
    for name in names:
        flat = responses[name].reshape(len(q), -1)
        apart = (flat - q @ (q.T @ flat)).reshape(len(columns), -1)
        left = apart - columns @ (columns.T @ apart)
        assert np.linalg.norm(left) < 1e-2 * np.linalg.norm(flat)


def block_by_block(values: np.ndarray, rows: list[np.ndarray], hat: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """(1 - H)^-1/2 times the values (n, 3) of each block, with the part H of the hat matrix in its rows."""
    adjusted = values.copy()
    for block in rows:
        part = hat(block)
        size, vectors = np.linalg.eigh(np.eye(len(part)) - part)
        root = vectors / np.sqrt(np.maximum(size, SINGULAR)) @ vectors.T
        adjusted[block] = (root @ values[block].reshape(len(part), -1)).reshape(values[block].shape)
    return adjusted


def test_blocks_of_any_sizes_are_adjusted_each_for_itself() -> None:
    rng = np.random.default_rng(0)
    block = np.repeat([4, 1, 0, 9, 2], [3, 1, 3, 2, 20])
    rows = [np.flatnonzero(block == b) for b in np.unique(block)]
    residualizer = Residualizer(rng.normal(size=(29, 4)))
    q, z = residualizer.q, rng.normal(size=(29, 3))
    found = residualizer.blocks(z, block)
    expected = block_by_block(residualizer(z), rows, lambda r: q[r] @ q[r].T)
    np.testing.assert_allclose(found.adjusted, expected, atol=1e-12)
    columns = np.linalg.qr(rng.normal(size=(87, 5)))[0]
    there = columns.reshape(29, 3, 5)
    flat = found.adjusted.ravel()
    apart = (flat - columns @ (columns.T @ flat)).reshape(29, 3)
    expected = block_by_block(apart, rows, lambda r: there[r].reshape(-1, 5) @ there[r].reshape(-1, 5).T)
    np.testing.assert_allclose(found.orthogonal_to(columns).adjusted, expected, atol=1e-12)


def test_candidates_are_screened_together_as_each_alone() -> None:
    rng = np.random.default_rng(1)
    rows = [rng.normal(size=(40, p)) * rng.uniform(0.1, 3.0, p) for p in rng.integers(0, 6, AT_ONCE + 9)]
    scores = [Scores(each, each.sum(axis=0)) for each in rows]
    together, alone = screen(scores, 3), [screen([score], 3) for score in scores]
    np.testing.assert_allclose(together.statistic, [float(each.statistic[0]) for each in alone], rtol=1e-12)
    largest = np.max([each.largest for each in alone], axis=0)
    np.testing.assert_allclose(together.largest, largest, rtol=1e-9)
    exceeded = np.mean(np.append(largest, np.inf) >= together.statistic[:, None], axis=1)
    np.testing.assert_allclose(together.p_value, exceeded, rtol=1e-12)


def test_candidates_are_searched_by_the_secant_over_95_percent_of_rigs(deployed: PushModel) -> None:
    evidence = evidence_of(deployed, pushes(20, 2))
    end = np.full((len(evidence.table), 1), 2.0 * BY_NAME["centre_x"].spread)
    more, less = (evidence.mechanics.shifted(("centre_x",), side * end, evidence.push)[0] for side in (1.0, -1.0))
    secant = np.einsum("nij,nj->ni", evidence.whitener, (more - less) / (2.0 * end[0]))
    np.testing.assert_allclose(whitened_response(evidence, "centre_of_friction")[:, :, 0], secant, rtol=1e-9, atol=1e-9)


def test_responses_are_computed_once_for_the_same_windows(deployed: PushModel, monkeypatch: pytest.MonkeyPatch) -> None:
    evidence, computed = evidence_of(deployed, pushes(20, 2)), []
    known = standardised.mechanism_named
    monkeypatch.setattr(standardised, "mechanism_named", lambda name: computed.append(name) or known(name))
    both = [whitened_response(evidence, name) for name in ("pusher_travel", "contact_friction") * 2]
    assert computed == ["pusher_travel", "contact_friction"]
    assert both[0] is both[2] and both[1] is both[3]
    some = whitened_response(evidence.take(np.arange(5)), "pusher_travel")
    np.testing.assert_allclose(some, both[0][:5], atol=1e-9)
