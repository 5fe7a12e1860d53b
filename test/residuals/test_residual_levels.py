# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The screen keeps its level with few pushes, and an obvious effect is still found; no effect is named twice."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_traces import DRIFT, planted, pushes, slippery
from search_bench import FEW, gate_of, search_with
from synthetic import square_rig

from push_predictor.models.push_model import PushModel
from push_predictor.models.train import train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import candidates_of
from push_predictor.residuals.channels.motion import motion_effects
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.residualizer import Residualizer, sums_by
from push_predictor.residuals.evidence.standardised import evidence_of
from push_predictor.residuals.selection.gate import baseline_of
from push_predictor.residuals.selection.search import SearchResult

TRIED = FEW
BLOCKS, ROWS = 20, 3  # a block


def searched(model: PushModel, table: PushTable, names: list[str], alpha: float = 0.01) -> SearchResult:
    return search_with(model, gate_of(model, evidence_of(model, table), names, alpha))


def test_block_scores_have_the_variance_of_the_observed_score_whatever_was_projected_off() -> None:
    rng = np.random.default_rng(5)
    n, block = BLOCKS * ROWS, np.repeat(np.arange(BLOCKS), ROWS)
    residualizer = Residualizer(rng.normal(size=(n, 6)))
    of_pushes = np.repeat(rng.normal(size=(BLOCKS, 3, 24)), ROWS, axis=0) + 0.3 * rng.normal(size=(n, 3, 24))
    basis = np.linalg.qr(residualizer(of_pushes).reshape(3 * n, -1))[0]
    nuisance, column = basis[:, :23], basis[:, 23].reshape(n, 3)
    total, rows = [], []
    for _ in range(500):
        apart = residualizer.blocks(rng.normal(size=(n, 3)), block).orthogonal_to(nuisance)
        total.append(float(np.sum(column * apart.residual)))
        rows.append(float(np.sum(sums_by(block, np.sum(column * apart.adjusted, axis=1)[:, None]) ** 2)))
    assert np.mean(rows) == pytest.approx(np.mean(np.square(total)), rel=0.18)


@pytest.mark.long
def test_nothing_is_found_in_few_pushes_without_an_effect_more_often_than_alpha(deployed: PushModel) -> None:
    """Twelve recordings of 40 pushes at level 0.2: if that is the rate, seven or more have a probability of 0.4 %."""
    count = 0
    for seed in range(20, 32):
        found = searched(deployed, pushes(40, seed), ["elapsed_time", "slider_heading", "edge"], alpha=0.2)
        count += bool(found.terms)
    assert count < 7


@pytest.mark.parametrize(("count", "seed", "size"), [(60, 2, 0.1), (24, 2, 0.2), (24, 3, 0.2)])
def test_an_obvious_effect_in_few_pushes_does_not_hide_itself(
    deployed: PushModel, count: int, seed: int, size: float
) -> None:
    """Against the gate's noise, which contains the effect, it would pass in one of five recordings of two dozen."""
    found = searched(deployed, pushes(count, seed, slippery(size)), ["elapsed_time", "slider_x"], alpha=0.004)
    assert found.terms[0].best.label == ("contact_friction", "elapsed_time")
    assert found.terms[0].p_value < 0.002


def test_a_few_pushes_far_off_are_not_obvious(deployed: PushModel) -> None:
    """Two pushes with an outlying covariate and outlying outcomes gain much, and prove little."""
    table = pushes(60, 3)
    odd = np.isin(table.push_id, [f"3-{k}" for k in (7, 31)])
    covariates = {**table.covariates, "topic:/odd": np.where(odd, 30.0, 0.0) + np.sin(np.arange(len(table)))}
    outcomes = table.outcomes + np.where(odd, 1.0, 0.0)[:, None] * [0.0006, 0.0006, 0.02]
    assert not searched(deployed, replace(table, covariates=covariates, outcomes=outcomes), ["topic:/odd"]).terms


@pytest.mark.parametrize("before, session", [(0.0, True), (-0.12, False)])
def test_a_constant_effect_of_an_analytical_base_is_new_unless_training_shows_it(before: float, session: bool) -> None:
    always = planted("contact_friction", "elapsed_time", replace(DRIFT, name="constant", drivers=()), -0.12)
    earlier = planted("contact_friction", "elapsed_time", replace(DRIFT, name="constant", drivers=()), before)
    table = pushes(100, 1, earlier) if before else pushes(100, 1)
    model = train_model(table, square_rig(), "analytical", name="deployed")
    found = motion_effects(model, evidence_of(model, pushes(100, 8, always)), 0.01, ["elapsed_time"])
    (term,) = found.terms
    assert term.best.label == ("contact_friction", "model_inputs") and term.since_training == session


def test_covariates_that_vary_along_a_push_are_not_tried(deployed: PushModel) -> None:
    """They share the tracker's noise with the residual."""
    table = pushes(60, 3)
    local = dict.fromkeys(("contact_gap", "time_since_contact"), np.tile([0.0, 0.2, 0.4], 60))
    evidence = evidence_of(deployed, replace(table, covariates={**table.covariates, **local}))
    inputs = inputs_basis(deployed, evidence.table)
    assert not {*local} & {c.covariate for c in candidates_of(evidence, None, inputs)}


def test_one_sided_pushes_are_compared_with_training_pushes_on_this_side(deployed: PushModel) -> None:
    later, kept = pushes(120, 7), deployed.training.inputs[:, 1]
    mechanics = evidence_of(deployed, later).mechanics
    on_side = later.inputs[later.inputs[:, 1] < 0.25]
    one_sided = baseline_of(deployed, mechanics, on_side).evidence.table
    assert 0.15 * len(kept) < len(one_sided) < 0.4 * len(kept)
    assert np.sum(one_sided.inputs[:, 1] < 0.22) == np.sum(kept < 0.22)
    assert np.all((one_sided.inputs[:, 1] < 0.3) | (one_sided.inputs[:, 1] > 0.95))


def test_training_is_compared_as_a_whole_with_pushes_everywhere_and_with_pushes_elsewhere(deployed: PushModel) -> None:
    later = pushes(120, 7)
    mechanics, faster = evidence_of(deployed, later).mechanics, later.inputs * [5.0, 1.0, 1.0]
    for inputs in (later.inputs, faster):
        assert len(baseline_of(deployed, mechanics, inputs).evidence.table) == len(deployed.training)
