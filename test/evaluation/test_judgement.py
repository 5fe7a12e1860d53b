# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The sentence that says whether a model fits a recording."""

from __future__ import annotations

from typing import Any

import pytest

from push_predictor.evaluation.judgement import judged
from push_predictor.evaluation.report.summary import opening_sentences

ALARM: dict[str, Any] = {"fired": False}


def metrics(share: float, pushes: int = 100, nmse: float | None = 0.2, **alarm: object) -> dict[str, Any]:
    """Metrics of a recording with this share of the outcomes inside 95 % intervals."""
    coverage = {"0.95": {"dx": share - 0.01, "dy": share, "dtheta": share + 0.01}}
    return {"n_train": 60, "n_pushes": pushes, "coverage": coverage, "nmse": {"total": nmse}, "alarm": ALARM | alarm}


@pytest.mark.parametrize(
    ("used", "label"), [(0, "fits"), (49, "fits"), (50, "fits its training"), (100, "fits its training")]
)
def test_a_fit_to_training_pushes_is_named_as_such(used: int, label: str) -> None:
    found = judged({**metrics(0.95), "n_training_pushes": used})
    assert found.label == label
    assert ("not used for training" in found.action) == (used >= 50)
    assert judged({**metrics(0.5), "n_training_pushes": used}).label == "too sure"


@pytest.mark.parametrize(
    ("found", "label"),
    [
        (metrics(0.93), "fits"),
        (metrics(0.9, pushes=25), "fits"),
        (metrics(0.9, pushes=400), "too sure"),
        (metrics(0.93, nmse=None), "fits"),
        (metrics(0.93, fired=True), "no longer fits"),
        (metrics(0.5, fired=True), "no longer fits"),
        (metrics(0.85), "too sure"),
        (metrics(0.93, nmse=3.0), "no better than the mean"),
        (metrics(0.93, pushes=9), "too few pushes"),
        (metrics(0.93, pushes=10), "fits"),
        (metrics(0.3, pushes=9), "too sure"),
        (metrics(0.93, pushes=9, fired=True), "no longer fits"),
        (metrics(0.93, pushes=9, off="few"), "too few pushes"),
        (metrics(0.93, off="few"), "no objection"),
        (metrics(0.5, off="few"), "too sure"),
    ],
)
def test_coverage_error_and_alarm_decide_the_label(found: dict[str, Any], label: str) -> None:
    assert judged(found).label == label


@pytest.mark.parametrize(
    ("low", "pushes", "label"),
    [(0.01, 100, "worse than physics"), (-0.01, 100, "fits"), (None, 100, "fits"), (0.01, 9, "too few pushes")],
)
def test_a_model_worse_than_textbook_physics_does_not_fit_whatever_its_coverage(
    low: float | None, pushes: int, label: str
) -> None:
    textbook = {"nmse": {"total": 0.5}, "difference": {"value": 0.16, "low": low, "high": 0.3}}
    found = judged({**metrics(0.95, pushes, 0.66), "textbook": textbook, "n_training_pushes": pushes - 1})
    assert found.label == ("fits its training" if label == "fits" else label)
    assert ("is 0.66, that of physics 0.5" in found.sentence) == (label == "worse than physics")
    assert len(found.sentence.split()) <= 25


@pytest.mark.parametrize(
    "found",
    [
        metrics(share, pushes, nmse, **alarm)
        for share in (0.3, 0.93)
        for pushes in (1, 9, 100)
        for nmse in (0.2, 3.0)
        for alarm in ({}, {"fired": True}, {"off": "few"})
    ],
)
def test_opening_has_three_plain_sentences(found: dict[str, Any]) -> None:
    interval = {"nmse": {"low": 0.1, "high": 0.3}}
    for sentence in opening_sentences({**found, "interval": interval}):
        assert sentence.endswith(".") and len(sentence.replace(" %", "%").split()) <= 25, sentence


def test_opening_gives_the_error_with_its_interval() -> None:
    found = {**metrics(0.93), "interval": {"nmse": {"low": 0.1, "high": 0.3}}}
    assert opening_sentences(found)[1].startswith("Its squared error (total NMSE) is 0.200 (95 % CI 0.100 to 0.300)")
    assert "CI" not in opening_sentences({**found, "interval": {"nmse": None}})[1]
    assert "has no scale" in opening_sentences({**found, "nmse": {"total": None}})[1]
