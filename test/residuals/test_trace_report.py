# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The report of a trace: its text for every verdict, that it is self-contained, and the numbers in its pictures."""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import made_up_traces as made_up
import numpy as np
import pytest
from made_up_traces import DRIFT, GRAIN, made_up_trace, planted, slippery, without_motion_effect

from push_predictor.evaluation.estimate import Estimate
from push_predictor.models.effects.covariates import UNITS
from push_predictor.models.mechanisms import LIBRARY, REFINEMENTS
from push_predictor.residuals import outcome
from push_predictor.residuals.channels.measurement import CORRECTIONS
from push_predictor.residuals.outcome import Sized, Trace
from push_predictor.residuals.reporting import page as report
from push_predictor.residuals.reporting.figures.driver_basis import (
    analysis_rows,
    binned,
    bins_of,
    per_push,
    responses,
    strength_of,
)
from push_predictor.residuals.reporting.page import best_of, role_of, write_trace_report
from push_predictor.residuals.reporting.phrases import COVARIATES, OTHERS, interval
from push_predictor.residuals.reporting.sentences import evidence, separating_words, summary_lines, worth
from push_predictor.residuals.reporting.sizes import shift_sizes

LATE = Sized("lateness of the slider's stamps", 0.012, 0.0105, 0.0135, "s")
FIFTH = Sized("change", 0.2, 0.1, 0.3, "1")


@pytest.fixture(scope="module")
def drift() -> Trace:
    """Contact friction that drifts; the push count correlates with the time."""
    rivals: dict[str, Any] = {"equivalent": ("push_index",), "undecided": True}
    return made_up_trace(slippery(0.06), verdict="mechanism_only", **rivals)


@pytest.fixture(scope="module")
def nothing() -> Trace:
    return made_up_trace(count=90)


def written(path: Path, trace: Trace) -> str:
    """The text of the page."""
    page = write_trace_report(path / "new" / "trace.html", trace).read_text()
    assert not re.search(r'(?:src|href)="(?!data:|#)', page), "the page is not self-contained"
    return unescape(re.sub(r"<[^>]+>", " ", page))


# --- the page --------------------------------------------------------------------------------------------------------


def test_page_contains_hash_split_rivals_and_gain(tmp_path: Path, drift: Trace) -> None:
    text = written(tmp_path, drift)
    assert drift.held_out.digest in text and "every third block of up to 10" in text
    assert "100 pushes, 300 windows" in text and "50 pushes, 150 windows" in text
    assert "Elapsed time and push count fit equally well." in text and "Pause for about half a session" in text
    assert re.search(r"contact friction\s+push count\s+[\d.]+\s+rival", text)
    assert re.search(r"contact friction\s+elapsed time\s+[\d.]+\s+found", text)
    assert "clock offset" in text and "a note for the reader" in text


def test_page_of_no_change_shows_the_closest_candidate_and_the_detectable_effects(
    tmp_path: Path, nothing: Trace
) -> None:
    text = written(tmp_path, nothing)
    assert "No change found." in text and "Not one of 24 candidates explains the residual of 60 pushes" in text
    assert "The closest candidate is contact friction, depending on elapsed time, with p = 0.3." in text
    assert "The smallest detectable effect of each mechanism" in text and "0.021" in text
    for heading in ("What else was tested", "Before, refit, after", "All metrics"):
        assert heading in text
    assert "The effect" not in text
    assert nothing.comparisons[-1].model == "refit"


def test_page_and_terminal_state_the_verdict(tmp_path: Path) -> None:
    """Of the other verdicts: see test_trace_page."""
    force = without_motion_effect("wrench_only", "surface_friction", "elapsed_time", FIFTH)
    grain = made_up_trace(planted(*GRAIN, 0.06, 0.03))
    for trace, words in (
        (force, "The force needed to push the slider changes with elapsed time; the motion does not"),
        (grain, "Direction-dependent friction of the table differs from the model"),
    ):
        assert words in written(tmp_path, trace)
        assert words in " ".join(summary_lines(trace)) and " ".join(summary_lines(trace)).isascii()


def test_page_accepts_fewer_windows_after_a_correction(tmp_path: Path) -> None:
    trace = without_motion_effect("measurement", "clock_offset", "model_inputs", LATE)
    held, fewer = trace.held_out, slice(0, 30)
    after = held.after
    cut = replace(
        after,
        push_id=after.push_id[fewer],
        mean=after.mean[fewer],
        covariance=after.covariance[fewer],
        observed=after.observed[fewer],
    )
    text = written(
        tmp_path, replace(trace, held_out=replace(held, after=cut), find_unexplained=lambda: trace.unexplained[:90])
    )
    assert "on windows cut again" in text and "The motion was not searched" in text


def test_page_escapes_names_from_the_data(tmp_path: Path, nothing: Trace) -> None:
    tested = (outcome.Tested("<script>", "topic:/<b>", 0.5),)
    page = write_trace_report(tmp_path / "trace.html", replace(nothing, tested=tested, notes=("<i>",))).read_text()
    assert not re.search("<script>|<b>|<i>", page)


# --- sentences -------------------------------------------------------------------------------------------------------


def test_verdict_starts_with_the_answer_then_size_and_interval(drift: Trace) -> None:
    verdict = evidence(drift)
    assert verdict.startswith("Contact friction changes with elapsed time. It shifts a window by 0.")
    assert re.search(r" is 0\.0\d+ \(95 % CI 0\.0\d+ to 0\.0\d+, p = 0\.001\)\. It explains 23 % of", verdict)
    assert max(len(sentence.split()) for sentence in re.split(r"[.;:] ", verdict)) <= 25


@pytest.mark.parametrize(
    ("gain", "kept", "words"),
    [
        (Estimate(-0.5, -0.6, -0.4), True, "The motion model is extended."),
        (Estimate(-0.1, -0.3, 0.1), False, "the effect does not improve the log density beyond chance"),
        (Estimate(-0.1, float("nan"), float("nan")), False, "too few pushes for an interval"),
    ],
)
def test_worth_sentence_separates_found_from_worth_modelling(
    drift: Trace, gain: Estimate, kept: bool, words: str
) -> None:
    trace = replace(drift, gain_nlpd=gain, extended=drift.extended if kept else None)
    assert words in worth(trace)


def test_verdict_explains_a_candidate_below_alpha_that_is_not_significant(nothing: Trace) -> None:
    near = replace(nothing, tested=(outcome.Tested("inertia", "velocity", 0.008),))
    assert "the level is divided among" in evidence(near)


def test_every_mechanism_and_covariate_has_a_phrase() -> None:
    assert {*CORRECTIONS, "surface_friction"} <= {*OTHERS}
    assert set(UNITS) <= set(COVARIATES)
    nouns = [mechanism.noun for mechanism in (*LIBRARY, *REFINEMENTS)]
    phrases = [*(covariate.phrase for covariate in COVARIATES.values()), *OTHERS.values(), *nouns]
    assert all(phrases) and not any("_" in phrase for phrase in phrases)


def test_intervals_show_the_digits_that_they_determine() -> None:
    assert interval(Estimate(0.764, 0.731, 0.802), p_value=0.001) == "0.76 (95 % CI 0.73 to 0.80, p = 0.001)"
    assert interval(Estimate(-12.04, -13.5, -10.5), "ms") == "−12.0 ms (95 % CI −13.5 to −10.5)"
    assert interval(Estimate(0.5, float("nan"), float("nan"))) == "0.5"


def test_advice_matches_the_rivals() -> None:
    assert len(separating_words(["elapsed_time", "push_index"])) == 1
    assert "Return to places" in " ".join(separating_words(["slider_x", "slid_distance"]))
    assert separating_words(["topic:/a", "topic:/b"]) == [
        "Vary topic /a and topic /b independently: change one while the others stay constant."
    ]


# --- what the pictures show ------------------------------------------------------------------------------------------


def test_bins_recover_the_planted_drift_with_and_without_an_extended_model(drift: Trace) -> None:
    strength = strength_of(drift.terms[0])
    for rows in (analysis_rows(drift), analysis_rows(replace(drift, extended=None))):
        time = rows.table.covariates["elapsed_time"]
        found = binned(strength, rows, responses(drift, strength, rows), time, bins_of(DRIFT, rows.table))
        truth = 0.06 * (found.place - 500.0) / 300.0
        inside = (found.low[:, 0] <= truth) & (truth <= found.high[:, 0])
        assert len(found.place) >= 3 and inside.mean() >= 0.6
        np.testing.assert_allclose(found.value[:, 0], truth, atol=0.04)


@pytest.mark.slow
def test_bins_follow_the_data_rather_than_a_wrong_fit() -> None:
    """A step, fitted by a line: the bins stay on the step."""
    trace = made_up_trace(planted("contact_friction", "elapsed_time", made_up.JUMP, 0.15), count=200)
    line = made_up.traced(trace.model, trace.analysis, trace.held_out.table, (slippery(0.1),))
    strength, rows = strength_of(line.terms[0]), analysis_rows(line)
    found = binned(
        strength,
        rows,
        responses(line, strength, rows),
        rows.table.covariates["elapsed_time"],
        bins_of(DRIFT, rows.table),
    )
    jump = found.value[found.place > 650.0, 0].mean() - found.value[found.place < 600.0, 0].mean()
    assert jump == pytest.approx(0.15, abs=0.04)
    early = found.value[found.place < 600.0, 0]
    assert abs(early[-1] - early[0]) < 0.4 * 0.15


def test_band_follows_the_covariance_of_the_coefficients(drift: Trace) -> None:
    strength = strength_of(drift.terms[0])
    _, half = strength.curve({"elapsed_time": np.array([500.0, 800.0])}, 2)
    np.testing.assert_allclose(half[:, 0], [0.0, 1.96 * np.sqrt(drift.terms[0].covariance[0, 0])], rtol=1e-12)


def test_single_pushes_have_the_curve_as_median(drift: Trace) -> None:
    strength, rows = strength_of(drift.terms[0]), analysis_rows(drift)
    place, value = per_push(strength, rows, responses(drift, strength, rows), rows.table.covariates["elapsed_time"])
    assert len(place) == len(drift.analysis.pushes)
    off = value[:, 0] - strength.curve({"elapsed_time": place}, len(place))[0][:, 0]
    assert abs(np.nanmedian(off)) < 0.02


def test_shift_intervals_contain_the_planted_size(drift: Trace) -> None:
    sizes = shift_sizes(drift, drift.terms[0], drift.analysis)
    exact = replace(drift.terms[0], coefficients=np.array([0.06]), covariance=np.zeros((1, 1)))
    true = shift_sizes(drift, exact, drift.analysis)
    for size, truth in zip(sizes.values(), true.values(), strict=True):
        assert size.low <= truth.value <= size.high and truth.low == pytest.approx(truth.value)


def test_tested_candidates_are_unique_pairs_with_smallest_p_and_role(drift: Trace) -> None:
    tested = (outcome.Tested("a", "x", 0.5), outcome.Tested("a", "x", 0.02), outcome.Tested(None, "x", 0.1))
    assert [(t.mechanism, t.p_value) for t in best_of(tested)] == [("a", 0.02), (None, 0.1)]
    roles = {(t.mechanism, t.covariate): role_of(drift, t) for t in drift.tested}
    assert roles["contact_friction", "elapsed_time"] == "found" and roles["contact_friction", "push_index"] == "rival"
    assert roles["pressure_spread", "push_index"] == ""


def test_every_verdict_has_a_name() -> None:
    assert set(report.VERDICTS) == {
        "none", "effect", "driver_only", "mechanism_only", "wrench_only", "measurement", "variance", "input_shift",
    }  # fmt: skip


def test_repr_states_verdict_effects_and_the_interval_of_the_gain(drift: Trace) -> None:
    lines = repr(replace(drift, gain_nlpd=Estimate(-0.2, -0.3, -0.1))).splitlines()
    effect = drift.effects[0]
    assert lines[0].endswith(f"verdict {drift.verdict}")
    assert f"depends on {effect.covariate}, p = {effect.p_value:.2g}" in lines[1]
    assert any("-0.200 (-0.300 to -0.100)" in line for line in lines)
