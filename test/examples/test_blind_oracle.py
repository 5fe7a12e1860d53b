# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The oracle of the blind benchmark is given the true mechanism, driver and basis, of both kinds of truth files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic import square_pushes

from benchmarks.blind import oracle
from benchmarks.blind.oracle import oracle_gain, true_term
from push_predictor.evaluation.estimate import Estimate
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.extension.held_out_gain import HeldOutGain


@pytest.fixture(scope="module")
def table() -> PushTable:
    plain, _ = square_pushes(40)
    rng = np.random.default_rng(1)
    index = np.arange(len(plain), dtype=np.float64)
    covariates = {"push_index": index, "elapsed_time": 3.0 * index, "dwell_time": rng.exponential(2.0, len(plain))}
    covariates |= {"slider_x": rng.normal(size=len(plain)), "slider_y": rng.normal(size=len(plain))}
    covariates |= {"contact": plain.inputs[:, 1], "edge": np.floor(4.0 * plain.inputs[:, 1]), "slider_heading": index}
    return replace(plain, covariates=covariates)


@pytest.mark.parametrize(("covariates", "form", "name", "course", "expected"), [
    (["session", "model_inputs"], "constant", "contact_friction", None, "constant"),
    (["session", "slider_x"], "constant", None, None, "constant"),
    (["push_index", "elapsed_time"], "step", "contact_friction", None, "step"),
    (["elapsed_time"], "linear", "contact_friction", None, "linear"),
    (["elapsed_time"], "linear", "contact_friction", "saturating", "logarithmic"),
    (["elapsed_time"], "saturating", "contact_friction", None, "logarithmic"),
    (["dwell_time", "time_since_contact"], "saturating", None, None, "logarithmic"),
    (["slider_x", "slider_y", "session"], "map", None, None, "map"),
    (["contact", "session", "edge"], "map", None, None, "quadratic"),
    (["edge", "contact"], "category", "contact_friction", None, "category"),
    (["slider_heading", "session"], "periodic", None, None, "periodic"),
])  # fmt: skip
def test_true_basis_follows_from_form_and_covariates(
    table: PushTable, covariates: list[str], form: str, name: str | None, course: str | None, expected: str
) -> None:
    record = {"names": [name], "covariates": covariates, "form": form, "place": 17.0}
    mechanism, covariate, basis = true_term(record if course is None else {**record, "course": course}, table)
    assert (mechanism, covariate, basis.name) == (name, covariates[0], expected)
    assert basis.place == 17.0 or form != "step"


def test_of_two_effects_the_oracle_has_both(table: PushTable, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Any] = []
    record = {"names": ["contact_friction"], "covariates": ["elapsed_time"], "form": "linear", "channel": "motion"}
    second = {"names": ["tilted_surface"], "covariates": ["session"], "form": "constant"}
    loaded = type("Loaded", (), {"table": table})
    for name in ("load_model", "refit_base", "evidence_of"):
        monkeypatch.setattr(oracle, name, lambda *arguments: None)
    monkeypatch.setattr(oracle, "load_evidence", lambda paths: loaded)
    monkeypatch.setattr(oracle, "candidate", lambda evidence, mechanism, covariate, basis: (mechanism, covariate))
    monkeypatch.setattr(oracle, "extend", lambda base, evidence, candidates: given.append(candidates))
    monkeypatch.setattr(oracle, "gain", lambda before, after, rest: (Estimate(0, 0, 0), Estimate(-0.3, -0.4, -0.2)))
    better = HeldOutGain("deployed", Estimate(0, 0, 0), Estimate(-0.2, -0.3, -0.1))
    monkeypatch.setattr(oracle, "held_out_gain", lambda *_: better)
    traced = {"value": -0.2, "low": -0.3, "high": -0.1}
    for truth in (record, {**record, "second": None}, {**record, "second": second}):
        found = oracle_gain(Path("new"), Path("model"), truth)
        assert found == {"value": -0.3, "low": -0.4, "high": -0.2, "traced": traced}
    first = ("contact_friction", "elapsed_time")
    assert given == [[first], [first], [first, ("tilted_surface", "session")]]
