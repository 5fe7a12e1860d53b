# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Moves of the search undo a wrong choice: a term that is not needed is dropped, and a worse one exchanged."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from made_up_traces import planted, pushes, slippery
from search_bench import gate_of, in_library
from synthetic import square_rig

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import Candidate, candidate
from push_predictor.residuals.candidates.joint_fit import Fit, FitRows
from push_predictor.residuals.evidence.drivers import standard_basis
from push_predictor.residuals.evidence.standardised import evidence_of
from push_predictor.residuals.selection.gate import Gate
from push_predictor.residuals.selection.search import _Search

FRICTION, SPREAD = ("contact_friction", "elapsed_time"), ("pressure_spread", "slider_x")
WARMER = ("contact_friction", "topic:/warmth")
ALONG_X = DriverBasis("linear", ("slider_x",), (0.0,), (0.1,))


@pytest.fixture(scope="module")
def deployed() -> PushModel:
    return train_model(pushes(100, 1), square_rig(), "analytical", name="deployed")


@pytest.fixture(autouse=True)
def a_library_of_two(monkeypatch: pytest.MonkeyPatch) -> None:
    """Computing responses takes most of the time."""
    in_library(monkeypatch, "contact_friction", "pressure_spread")


def moved(model: PushModel, table: PushTable, *labels: tuple[str, str]) -> list[tuple[str | None, str]]:
    """The labels after the moves from linear terms with these, where the gate let pass all that occur here."""
    evidence = evidence_of(model, table)
    gate = gate_of(model, evidence, ["elapsed_time", "slider_x", "topic:/warmth"])
    search = _Search(gate, FitRows(evidence), dict.fromkeys([FRICTION, SPREAD, WARMER], 0.001))
    chosen = [_linear(evidence_of(model, table).table, model, *label) for label in labels]
    after, _ = search._improved(chosen, search._fit(chosen))
    return [term.label for term in after]


def _linear(table: PushTable, model: PushModel, mechanism: str, covariate: str) -> Candidate:
    basis = replace(standard_basis("linear", covariate, table.covariates[covariate]), offset=True)
    return candidate(evidence_of(model, table), mechanism, covariate, basis)


def warmed(table: PushTable) -> PushTable:
    """The pushes in a room that gets warmer with the time, but not evenly."""
    time = table.covariates["elapsed_time"] / 300.0
    uneven = 0.4 * np.repeat(np.random.default_rng(7).normal(size=len(table.pushes)), 3)
    return replace(table, covariates={**table.covariates, "topic:/warmth": 20.0 + time + uneven})


def both(seed: int = 3) -> PushTable:
    return warmed(pushes(120, seed, slippery(0.1), planted("pressure_spread", "slider_x", ALONG_X, 0.1)))


def test_terms_that_are_needed_stay(deployed: PushModel) -> None:
    assert sorted(map(str, moved(deployed, both(), FRICTION, SPREAD))) == sorted(map(str, (FRICTION, SPREAD)))


def test_a_term_that_another_explains_is_dropped(deployed: PushModel) -> None:
    table = warmed(pushes(120, 3, slippery(0.1)))
    assert moved(deployed, table, SPREAD, FRICTION) == [FRICTION]
    assert moved(deployed, table, FRICTION, SPREAD) == [FRICTION]


def test_a_term_with_a_worse_covariate_is_exchanged(deployed: PushModel) -> None:
    assert set(moved(deployed, both(), WARMER, SPREAD)) == {FRICTION, SPREAD}
    assert set(moved(deployed, both(), SPREAD, WARMER)) == {FRICTION, SPREAD}


def test_an_only_term_stays_as_it_was_chosen(deployed: PushModel) -> None:
    assert moved(deployed, warmed(pushes(120, 3)), FRICTION) == [FRICTION]


@pytest.mark.parametrize(
    ("gain", "further", "size", "enough"),
    [
        (8.0, False, 1, False),
        (12.0, False, 1, True),
        (12.0, False, 6, True),
        (12.0, True, 1, True),
        (12.0, True, 6, False),
        (32.0, True, 6, True),
    ],
)
def test_a_term_must_gain_its_error_and_a_further_one_five_nats_a_coefficient(
    deployed: PushModel, gain: float, further: bool, size: int, enough: bool
) -> None:
    """A standard error of 10 nats over 100 blocks."""
    rows = FitRows(evidence_of(deployed, pushes(100, 1)))
    search = _Search(cast("Gate", None), rows)
    uneven = np.where(np.arange(100) % 2, 1.0, -1.0)
    before, after = (
        cast("Fit", SimpleNamespace(scores=scores, coefficients=np.zeros(count)))
        for scores, count in ((np.zeros(100), 0), (uneven + gain / 100.0, size))
    )
    assert search._worthwhile(after, before, further) == enough
