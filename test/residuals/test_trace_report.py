"""The report of a trace: what it says for every verdict, that it stands alone, and the numbers behind its pictures."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import made_up_traces as made_up
import numpy as np
import pytest
from made_up_traces import DRIFT, EXPERIMENT, GRAIN, PLACE, made_up_trace, planted, slippery, told

from push_predictor.evaluation.report.maps import Cells, PushMap
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.residuals import outcome
from push_predictor.residuals.outcome import Gain, Sized, Trace
from push_predictor.residuals.reporting import page as report
from push_predictor.residuals.reporting.advice import separating_words
from push_predictor.residuals.reporting.figures import gallery, map_pictures
from push_predictor.residuals.reporting.figures.driver_basis import bins_of
from push_predictor.residuals.reporting.figures.maps import halves_of, scale_of
from push_predictor.residuals.reporting.figures.partial import (
    analysis_rows,
    binned,
    held_out_rows,
    per_push,
    responses,
    shift_of,
    strength_of,
)
from push_predictor.residuals.reporting.figures.shifts import binned_means, course_of
from push_predictor.residuals.reporting.figures.tested import best_of, role_of
from push_predictor.residuals.reporting.page import write_trace_report
from push_predictor.residuals.reporting.summary import comparisons_of, summary_lines
from push_predictor.residuals.reporting.wording import shift_sizes, verdict_sentence, worth_sentence

LATE = Sized("lateness of the slider's stamps", 0.012, 0.0105, 0.0135, "s")
PIXEL = bytes.fromhex("89504e470d0a1a0a")
UNKNOWN = [0.0] * 8 + [0.018] + [0.0] * 5 + [0.6] + [0.0] * 3  # dy and dtheta over the angle


@pytest.fixture(scope="module")
def drift() -> Trace:
    """Contact friction that drifts; the push's number goes with the time."""
    rivals: dict[str, Any] = {"equivalent": ("push_index",), "undecided": True, "experiment": EXPERIMENT}
    return made_up_trace(slippery(0.06), verdict="mechanism_only", **rivals)


@pytest.fixture(scope="module")
def nothing() -> Trace:
    return made_up_trace(count=90)


@pytest.fixture
def unpainted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures take seconds: here they are placeholders."""

    def draw(path: Path, size: object, paint: object) -> Path:
        path.write_bytes(PIXEL)
        return path

    for module in (gallery, map_pictures):
        monkeypatch.setattr(module, "draw", draw)


def written(path: Path, trace: Trace) -> str:
    """The page's text."""
    page = write_trace_report(path / "new" / "trace.html", trace).read_text()
    assert not re.search(r'(?:src|href)="(?!data:|#)', page), "the page does not stand alone"
    return unescape(re.sub(r"<[^>]+>", " ", page))


# --- the page --------------------------------------------------------------------------------------------------------


def test_a_whole_page_is_written_with_its_pictures_in_it(tmp_path: Path, drift: Trace) -> None:
    page = write_trace_report(tmp_path / "trace.html", drift)
    assert [path.name for path in tmp_path.iterdir()] == ["trace.html"]
    pictures = re.findall(r'<img alt="([^"]+)" src="data:image/png;base64,([^"]+)"', page.read_text())
    assert len(pictures) == 6 and all(len(data) > 10_000 for _, data in pictures)


def test_the_page_tells_what_an_argument_needs(tmp_path: Path, unpainted: None, drift: Trace) -> None:
    text = written(tmp_path, drift)
    assert drift.held_out.digest in text and "every third block of up to 10" in text
    assert "100 pushes, 300 windows" in text and "50 pushes, 150 windows" in text
    assert "these data cannot tell whether elapsed_time drives it or push_index" in text
    assert "Pushes that would separate the rivals" in text and "Rest the rig" in text
    assert re.search(r"contact friction\s+push_index\s+[\d.]+\s+rival", text)
    assert re.search(r"contact friction\s+elapsed_time\s+[\d.]+\s+found", text)
    assert "clock offset" in text and "after minus refit" in text and "a note for the reader" in text
    assert re.search(r"The other \d+ candidates", text)


def test_nothing_found_is_a_page_of_equal_care(tmp_path: Path, unpainted: None, nothing: Trace) -> None:
    text = written(tmp_path, nothing)
    assert "Nothing found: of 24 candidates none explains the residual of 60 pushes" in text
    assert "the nearest was contact friction, driven by elapsed_time, with p = 0.3" in text
    assert "smallest effect of each mechanism that would have been found" in text and "0.021" in text
    for heading in ("Residuals before and after", "What else was tested", "Before, refit, after", "Calibration"):
        assert heading in text
    assert "The effect" not in text and "after minus refit" not in text
    assert comparisons_of(nothing)[-1].model == "refit"


@pytest.mark.parametrize(
    ("trace", "words"),
    [
        (lambda: told("measurement", "clock_offset", "model_inputs", LATE), "stamps 12 (95 %: 10.5 to 13.5) ms"),
        (
            lambda: told("wrench_only", "surface_friction", "elapsed_time", Sized("change", 0.2, 0.1, 0.3, "1")),
            "The force changed and the motion did not; the motion model is left alone: surface friction, driven by",
        ),
        (lambda: told("variance", "", "elapsed_time", None), "scatter of dy "),
        (
            lambda: made_up_trace(planted(None, "elapsed_time", DRIFT, *UNKNOWN), verdict="driver_only"),
            "The motion changes with elapsed_time, by a mechanism that the library does not hold",
        ),
        (lambda: made_up_trace(planted(*GRAIN, 0.06, 0.03)), "anisotropic friction, driven by push_heading"),
        (
            lambda: made_up_trace(planted("contact_friction", "slider_x", PLACE, 0.05, -0.03, 0, 0, 0)),
            "driven by slider_x (map)",
        ),
    ],
)
def test_every_verdict_has_its_page(tmp_path: Path, unpainted: None, trace: Callable[[], Trace], words: str) -> None:
    found = trace()
    assert words in written(tmp_path, found)
    assert words in " ".join(summary_lines(found)) and " ".join(summary_lines(found)).isascii()


def test_windows_cut_again_may_be_others(tmp_path: Path, unpainted: None) -> None:
    trace = told("measurement", "clock_offset", "model_inputs", LATE)
    held, fewer = trace.held_out, slice(0, 30)
    after = held.after
    cut = replace(
        after,
        push_id=after.push_id[fewer],
        mean=after.mean[fewer],
        covariance=after.covariance[fewer],
        observed=after.observed[fewer],
    )
    text = written(tmp_path, replace(trace, held_out=replace(held, after=cut), unexplained=trace.unexplained[:90]))
    assert "on windows cut again" in text and "The motion was not searched" in text


def test_what_is_in_the_data_is_shown_not_run(tmp_path: Path, unpainted: None, nothing: Trace) -> None:
    tested = (outcome.Tested("<script>", "topic:/<b>", 0.5),)
    page = write_trace_report(tmp_path / "trace.html", replace(nothing, tested=tested, notes=("<i>",))).read_text()
    assert not re.search("<script>|<b>|<i>", page)


# --- sentences -------------------------------------------------------------------------------------------------------


def test_the_verdict_is_one_sentence_with_size_unit_and_interval(drift: Trace) -> None:
    sentence = verdict_sentence(drift)
    assert sentence[0].isupper() and sentence.count(". ") == 0 and sentence.endswith(".")
    assert re.search(r"change per 300 s 0\.0\d+ \(95 %: 0\.0\d+ to 0\.0\d+\)", sentence)


@pytest.mark.parametrize(
    ("gain", "kept", "words"),
    [
        (Gain(-0.5, -0.6, -0.4), True, "so the motion model is extended"),
        (Gain(-0.1, -0.3, 0.1), False, "found, but not worth modelling"),
        (Gain(-0.1, float("nan"), float("nan")), False, "too few pushes for an interval"),
    ],
)
def test_found_and_worth_modelling_are_two_verdicts(drift: Trace, gain: Gain, kept: bool, words: str) -> None:
    trace = replace(drift, gain_nlpd=gain, extended=drift.extended if kept else None)
    assert words in worth_sentence(trace)


def test_a_candidate_below_alpha_that_was_not_found_is_explained(nothing: Trace) -> None:
    near = replace(nothing, tested=(outcome.Tested("inertia", "velocity", 0.008),))
    assert "the level is shared" in verdict_sentence(near)


def test_advice_fits_the_rivals() -> None:
    assert len(separating_words(["elapsed_time", "push_index"])) == 1
    assert "Return to places" in " ".join(separating_words(["slider_x", "slid_distance"]))
    assert separating_words(["topic:/a", "topic:/b"]) == [
        "Change one of topic:/a, topic:/b while the others stay, and then the next."
    ]


# --- what the pictures show ------------------------------------------------------------------------------------------


def test_bins_show_the_planted_drift_and_held_out_pushes_agree(drift: Trace) -> None:
    strength = strength_of(drift.terms[0], drift.analysis)
    for rows in (analysis_rows(drift), held_out_rows(drift), analysis_rows(replace(drift, extended=None))):
        time = rows.table.covariates["elapsed_time"]
        found = binned(strength, rows, responses(drift, strength, rows), time, bins_of(DRIFT, rows.table))
        truth = 0.06 * (found.place - 500.0) / 300.0
        inside = (found.low[:, 0] <= truth) & (truth <= found.high[:, 0])
        assert len(found.place) >= 3 and inside.mean() >= 0.6
        np.testing.assert_allclose(found.value[:, 0], truth, atol=0.04)


def test_bins_do_not_repeat_the_fit_where_the_data_say_otherwise() -> None:
    """A step, fitted by a line: the bins stay on the step."""
    trace = made_up_trace(planted("contact_friction", "elapsed_time", made_up.JUMP, 0.15), count=200)
    line = made_up.traced(trace.model, trace.analysis, trace.held_out.table, (slippery(0.1),))
    strength, rows = strength_of(line.terms[0], line.analysis), analysis_rows(line)
    found = binned(
        strength,
        rows,
        responses(line, strength, rows),
        rows.table.covariates["elapsed_time"],
        bins_of(DRIFT, rows.table),
    )
    jump = found.value[found.place > 650.0, 0].mean() - found.value[found.place < 600.0, 0].mean()
    assert jump == pytest.approx(0.15, abs=0.04)
    fitted = strength.curve({"elapsed_time": np.array([0.0, 600.0])}, 2)[0][:, 0]
    early = found.value[found.place < 600.0, 0]
    assert abs(early[-1] - early[0]) < 0.5 * (fitted[1] - fitted[0])


def test_the_band_is_that_of_the_coefficients(drift: Trace) -> None:
    strength = strength_of(drift.terms[0], drift.analysis)
    _, half = strength.curve({"elapsed_time": np.array([500.0, 800.0])}, 2)
    np.testing.assert_allclose(half[:, 0], [0.0, 1.96 * np.sqrt(drift.terms[0].covariance[0, 0])], rtol=1e-12)


def test_single_pushes_scatter_about_the_curve(drift: Trace) -> None:
    strength, rows = strength_of(drift.terms[0], drift.analysis), analysis_rows(drift)
    place, value = per_push(strength, rows, responses(drift, strength, rows), rows.table.covariates["elapsed_time"])
    assert len(place) == len(drift.analysis.pushes)
    off = value[:, 0] - strength.curve({"elapsed_time": place}, len(place))[0][:, 0]
    assert abs(np.nanmedian(off)) < 0.02


def test_an_unknown_mechanism_is_shown_by_its_strongest_pattern() -> None:
    trace = made_up_trace(planted(None, "elapsed_time", DRIFT, *UNKNOWN))
    strength = strength_of(trace.terms[0], trace.analysis)
    rows = analysis_rows(trace)
    value = strength.curve(rows.table.covariates, len(rows.table))[0]
    assert np.sqrt(np.mean(value**2)) == pytest.approx(1.0)
    shown = np.einsum("nkq,nq->nk", responses(trace, strength, rows), value)
    whole = np.einsum("nij,nj->ni", rows.whitener, shift_of(trace, trace.terms[0], trace.analysis))
    np.testing.assert_allclose(shown, whole, atol=1e-9)  # one column of the basis: the pattern is all of it
    assert strength.share == pytest.approx(1.0)


def test_a_constant_effect_is_shown_over_the_angle_by_contact() -> None:
    trace = made_up_trace(planted("contact_friction", "model_inputs", DriverBasis("constant"), -0.08), count=200)
    rows, effect = analysis_rows(trace), trace.terms[0]
    course = course_of(effect, trace.model.rig.outline, rows)
    assert len(course.groups) == 3 and "angle" in course.label
    for _, group in course.groups:
        means = binned_means(trace, effect, rows, course.x, group, 1)
        assert np.mean((means.low <= means.fitted) & (means.fitted <= means.high)) >= 0.6
    headed = planted(*GRAIN, 0.06, 0.03)
    assert "push_heading" in course_of(headed, trace.model.rig.outline, rows).label


def test_maps_are_split_where_the_effect_turns_its_sign(drift: Trace, nothing: Trace) -> None:
    halves = halves_of(strength_of(drift.terms[0], drift.analysis), drift.analysis)
    assert halves.names == ("elapsed_time: lower", "elapsed_time: higher")
    time = drift.analysis.covariates["elapsed_time"]
    assert time[halves.masks[0]].max() <= time[halves.masks[1]].min()
    assert len(halves_of(None, nothing.analysis).masks) == 1


def test_maps_share_one_scale_about_zero_that_noise_does_not_fill() -> None:
    scale = scale_of_noise(0.3)
    assert (scale.low, scale.high) == (-1.0, 1.0)
    wide = scale_of_noise(4.0)
    assert wide.low == -wide.high and wide.high > 2.0


def scale_of_noise(size: float) -> Any:
    mean = size * np.linspace(-1.0, 1.0, 27).reshape(3, 3, 3)
    cells = Cells(np.linspace(0.0, 0.09, 4), np.linspace(-0.5, 0.5, 4))
    return scale_of([PushMap(cells, mean, np.abs(mean))])


def test_shifts_have_the_planted_size(drift: Trace) -> None:
    sizes = shift_sizes(drift, drift.terms[0], drift.analysis)
    exact = replace(drift.terms[0], coefficients=np.array([0.06]), covariance=np.zeros((1, 1)))
    for size, truth in zip(sizes, shift_sizes(drift, exact, drift.analysis), strict=True):
        assert size.low <= truth.value <= size.high and truth.low == pytest.approx(truth.value)


def test_one_line_a_pair_with_its_smallest_p_and_its_role(drift: Trace) -> None:
    tested = (outcome.Tested("a", "x", 0.5), outcome.Tested("a", "x", 0.02), outcome.Tested(None, "x", 0.1))
    assert [(t.mechanism, t.p_value) for t in best_of(tested)] == [("a", 0.02), (None, 0.1)]
    roles = {(t.mechanism, t.covariate): role_of(drift, t) for t in drift.tested}
    assert roles["contact_friction", "elapsed_time"] == "found" and roles["contact_friction", "push_index"] == "rival"
    assert roles["pressure_spread", "push_index"] == ""


def test_every_verdict_of_the_contract_has_a_name() -> None:
    assert set(report.VERDICTS) == {
        "none", "effect", "driver_only", "mechanism_only", "wrench_only", "measurement", "variance",
    }  # fmt: skip
