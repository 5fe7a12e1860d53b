"""The sentence that says whether a model fits a recording."""

from __future__ import annotations

from typing import Any

import pytest

from push_predictor.evaluation.judgement import judgement

ALARM: dict[str, Any] = {"fired": False}


def metrics(share: float, pushes: int = 100, nmse: float = 0.2, **alarm: object) -> dict[str, Any]:
    """Metrics of a recording with this share of the outcomes inside 95 % intervals."""
    coverage = {"0.95": {"dx": share - 0.01, "dy": share, "dtheta": share + 0.01}}
    return {"n_pushes": pushes, "coverage": coverage, "nmse": {"total": nmse}, "alarm": ALARM | alarm}


@pytest.mark.parametrize(
    ("found", "sentence"),
    [
        (metrics(0.93), "The model fits: 95 % intervals cover 93 % of the outcomes of 100 pushes; no alarm."),
        (metrics(0.93, fired=True), "The model no longer fits: the alarm fired; 95 % intervals cover 93 %"),
        (metrics(0.5, fired=True), "The model no longer fits: the alarm fired; 95 % intervals cover 50 %"),
        (metrics(0.85), "The model is too sure: 95 % intervals cover 85 % of the outcomes of 100 pushes; no alarm."),
        (
            metrics(0.93, nmse=3.0),
            "The model predicts no better than the mean of its training outcomes; 95 % intervals",
        ),
        (metrics(0.93, off="few"), "Nothing speaks against the model: 95 % intervals cover 93 %"),
        (metrics(0.5, off="few"), "The model is too sure: 95 % intervals cover 50 %"),
    ],
)
def test_states_the_answer_first(found: dict[str, Any], sentence: str) -> None:
    assert judgement(found).startswith(sentence)


def test_says_that_no_alarm_was_computed() -> None:
    assert judgement(metrics(0.93, off="few")).endswith("of 100 pushes; no alarm was computed.")


@pytest.mark.parametrize(("pushes", "fits"), [(25, True), (400, False)])
def test_the_same_coverage_speaks_against_a_model_only_with_enough_pushes(pushes: int, fits: bool) -> None:
    assert judgement(metrics(0.9, pushes)).startswith("The model fits" if fits else "The model is too sure")


def test_an_nmse_that_the_data_do_not_determine_is_no_judgement() -> None:
    assert judgement({**metrics(0.95), "nmse": {"total": None}}).startswith("The model fits")
