# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The sentence that says whether a model fits a recording."""

from __future__ import annotations

from typing import Any

import pytest

from push_predictor.evaluation.judgement import judged, judgement
from push_predictor.evaluation.report.summary import opening_sentences

ALARM: dict[str, Any] = {"fired": False}


def metrics(share: float, pushes: int = 100, nmse: float = 0.2, **alarm: object) -> dict[str, Any]:
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
    ("found", "sentence"),
    [
        (metrics(0.93), "The model fits: 95 % intervals cover 93 % of the outcomes of 100 pushes; no alarm."),
        (metrics(0.93, fired=True), "The model no longer fits: the alarm fired; 95 % intervals cover 93 %"),
        (metrics(0.5, fired=True), "The model no longer fits: the alarm fired; 95 % intervals cover 50 %"),
        (metrics(0.85), "The model is too sure: 95 % intervals cover 85 % of the outcomes of 100 pushes; no alarm."),
        (
            metrics(0.93, nmse=3.0),
            "The model predicts no better than the training mean; 95 % intervals",
        ),
        (metrics(0.93, pushes=9), "Too few pushes to judge the model: 95 % intervals cover 93 % of the outcomes of 9"),
        (metrics(0.93, pushes=10), "The model fits"),
        (
            metrics(1.0, pushes=1),
            "Too few pushes to judge the model: 95 % intervals cover 100 % of the outcomes of 1 p",
        ),
        (metrics(0.3, pushes=9), "The model is too sure"),
        (metrics(0.93, pushes=9, fired=True), "The model no longer fits"),
        (metrics(0.93, pushes=9, off="few"), "Too few pushes to judge the model"),
        (metrics(0.93, off="few"), "Nothing speaks against the model: 95 % intervals cover 93 %"),
        (metrics(0.5, off="few"), "The model is too sure: 95 % intervals cover 50 %"),
    ],
)
def test_states_the_answer_first(found: dict[str, Any], sentence: str) -> None:
    assert judgement(found).startswith(sentence)


@pytest.mark.parametrize(
    ("found", "label", "action"),
    [
        (metrics(0.93), "fits", "Use the model for pushes like these."),
        (metrics(0.93, fired=True), "no longer fits", "Find the cause with `push_predictor trace`"),
        (metrics(0.85), "too sure", "Do not rely on its intervals."),
        (metrics(0.93, nmse=3.0), "no better than the mean", "Check slider, frames and units"),
        (metrics(0.93, pushes=9), "too few pushes", "Record at least 10 pushes, then validate again."),
        (metrics(0.93, off="few"), "no objection", "Use the model, but watch its errors"),
    ],
)
def test_a_label_and_an_action_belong_to_each_judgement(found: dict[str, Any], label: str, action: str) -> None:
    assert judged(found).label == label and judged(found).action.startswith(action)


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


def test_says_that_no_alarm_was_computed() -> None:
    assert judgement(metrics(0.93, off="few")).endswith("of 100 pushes; no alarm was computed.")


@pytest.mark.parametrize(("pushes", "fits"), [(25, True), (400, False)])
def test_the_same_coverage_speaks_against_a_model_only_with_enough_pushes(pushes: int, fits: bool) -> None:
    assert judgement(metrics(0.9, pushes)).startswith("The model fits" if fits else "The model is too sure")


def test_an_nmse_that_the_data_do_not_determine_is_no_judgement() -> None:
    assert judgement({**metrics(0.95), "nmse": {"total": None}}).startswith("The model fits")
