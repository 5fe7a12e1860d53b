# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a reader of a trace sees: the answer in three sentences, pictures and their numbers, folded tables."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_traces import (
    JUMP,
    LATE,
    TRACES,
    made_up_trace,
    planted,
    pushes,
    shifted,
    slippery,
    trace_of,
    traced,
    without_motion_effect,
)

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.push_scores import push_means
from push_predictor.models.effects.covariates import UNITS
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.mechanisms import LIBRARY, REFINEMENTS
from push_predictor.recordings.table import PushTable
from push_predictor.reporting.chart import Bars, Dots
from push_predictor.residuals import outcome
from push_predictor.residuals.channels.measurement import CORRECTIONS
from push_predictor.residuals.outcome import Sized, Trace, best_of, trace_json
from push_predictor.residuals.reporting.figures.driver_basis import (
    analysis_rows,
    basis_charts,
    per_push,
    responses,
    strength_of,
)
from push_predictor.residuals.reporting.figures.gallery import effect_figures
from push_predictor.residuals.reporting.figures.pushes import axis_of, bins_along, error_charts, gap_chart, means_along
from push_predictor.residuals.reporting.page import role_of, write_trace_report
from push_predictor.residuals.reporting.phrases import COVARIATES, OTHERS, interval, shift_size
from push_predictor.residuals.reporting.sentences import answer, evidence, separating_words, summary_lines, worth

ROW = '<tr><th scope="row">'
RAW = r"\bNone\b|\bnan\b|\binf\b|\bTrue\b|\bFalse\b|np\.|array\(|`|\b[a-z]+_[a-z_]+\b|Sized\(|\{|\}"


@pytest.fixture
def drift() -> Trace:
    """Contact friction that drifts; the push count correlates with the time."""
    return trace_of("mechanism_only")


@pytest.fixture
def nothing() -> Trace:
    return trace_of("none")


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], str]:
    """The page of a trace by its name in TRACES."""
    folder = tmp_path_factory.mktemp("pages")

    @cache
    def page(name: str) -> str:
        return write_trace_report(folder / f"{name}.html", trace_of(name)).read_text()

    return page


def text_of(page: str) -> str:
    """What a reader sees, hover texts included."""
    body = page[page.index("<body>") :]
    return unescape(re.sub(r"<[^>]+>", "\n", body))


def written(path: Path, trace: Trace) -> str:
    """The text of the page."""
    page = write_trace_report(path / "new" / "trace.html", trace).read_text()
    assert not re.search(r'(?:src|href)="(?!data:|#)', page), "the page is not self-contained"
    return unescape(re.sub(r"<[^>]+>", " ", page))


def sentences_of(page: str) -> list[str]:
    """The paragraphs of the answer."""
    block = re.search(r'<div class="answer">(.*?)</div>', page, re.S)
    assert block
    return [unescape(text) for text in re.findall(r"<p>(.*?)</p>", block[1], re.S)]


# --- the answer ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TRACES)
def test_page_begins_with_three_plain_sentences_shows_no_raw_values_and_folds_its_tables(
    pages: Callable[[str], str], name: str
) -> None:
    page = pages(name)
    found = sentences_of(page)
    assert len(found) == 3 and page.index('class="answer"') < page.index("<svg")
    for sentence in found:
        assert sentence.endswith(".") and ". " not in sentence and len(sentence.split()) <= 25, sentence
    raw = re.findall(RAW, text_of(page))
    assert not raw, raw
    assert not re.search(r'(?:src|href)="(?!data:|#)', page), "the page is not self-contained"
    folded = sum(part.count("<table") for part in re.findall(r"<details.*?</details>", page, re.S))
    assert folded == page.count("<table") > 0


@pytest.mark.parametrize(
    ("name", "change", "size", "action"),
    [
        ("none", r"^No change found\.$", r"change of contact friction by 0\.021 would have been found", "no action"),
        ("effect", r"^Contact friction changed 620 s into the session\.$",
         r"^It shifts a window by 0\.\d+ mm and 0\.\d+ deg: change per 300 s is 0\.1\d+ \(95 % CI .*\)\.$",
         r"^Use the extended model: on 50 held-out pushes its squared error is \d+ % lower than after retraining"),
        ("two effects", "with elapsed time, and 1 further change was found", r"\(95 % CI", "^Use the extended model"),
        ("mechanism_only", "^Contact friction changes with elapsed time", r"\(95 % CI",
         r"^Use the extended model, and vary elapsed time and push count independently: these pushes do not"),
        ("category", r"^Contact friction differs by side pushed\.$", "^It shifts a window by", ""),
        ("driver_only", "^Weak evidence: .* no known mechanism fits",
         r"^It shifts a window by 0\.\d+ mm and 0\.\d+ deg\.$",
         "^Keep the deployed model"),
        ("wrench_only", "^The force needed to push the slider differs from training; the motion does not",
         r"^The relative change of the force since training is 0\.20 \(95 % CI 0\.10 to 0\.30\)\.$",
         "^Keep the motion model"),
        ("measurement", "not the motion model: a clock offset between tracker and robot",
         r"^The lateness of the slider's stamps is 12\.0 ms \(95 % CI 10\.5 to 13\.5\)\.$", "^Synchronise the clocks"),
        ("variance", "^The noise of the outcomes changes with elapsed time", r"^The factor on the noise is 1\.5 \(",
         "^Retrain the model"),
        ("input_shift", r"^Pushing speed is now 100 to 150 mm/s, in training 10 to 50 mm/s\.$",
         r"^97 % of the windows lie outside the range of training\.$", "^Train on pushes in the new range"),
    ],
)  # fmt: skip
def test_answer_states_what_changed_how_big_it_is_and_what_to_do(
    name: str, change: str, size: str, action: str
) -> None:
    found = answer(trace_of(name))
    for sentence, pattern in zip(found, (change, size, action), strict=True):
        assert re.search(pattern, sentence), sentence


@pytest.mark.parametrize(
    ("extended", "gain", "better", "words"),
    [
        (False, Estimate(-0.1, -0.3, 0.1), False, "Keep the deployed model: on 50 held-out pushes the effect does not"),
        (False, Estimate(-0.1, -0.3, 0.1), True, "Retrain the model on the new pushes: that lowers the errors"),
        (
            False,
            Estimate(-0.1, np.nan, np.nan),
            False,
            "Keep the deployed model: there are too few pushes for an interval",
        ),
        (False, Estimate(0.0, 0.0, 0.0), True, "Retrain the model on the new pushes: that is enough"),
        (False, Estimate(0.0, 0.0, 0.0), False, "Keep the deployed model: on 50 held-out pushes retraining does not"),
        (True, Estimate(-0.5, -0.6, -0.4), True, "Use the extended model: on 50 held-out pushes"),
    ],
)
def test_action_follows_from_the_gain_and_from_retraining(
    extended: bool, gain: Estimate, better: bool, words: str
) -> None:
    trace = trace_of("effect")
    held = trace.held_out
    held = replace(held, refit=held.after if better else held.before)
    model = trace.extended if extended else None
    assert answer(replace(trace, held_out=held, gain_nlpd=gain, extended=model))[2].startswith(words)


@pytest.mark.parametrize(
    ("gain", "words"),
    [
        (Estimate(-0.1, -0.3, 0.1), "some 600 pushes would confirm it (now 150)"),  # its interval is twice as wide
        (Estimate(-0.1, -0.2, 0.0), "some 150 pushes"),
        (Estimate(-0.01, -0.3, 0.3), "more than 100 times as many pushes"),
        (Estimate(0.1, -0.1, 0.3), ""),
        (Estimate(-0.1, float("nan"), float("nan")), ""),
    ],
)
def test_unconfirmed_effect_is_weak_evidence_and_the_page_states_how_many_pushes_settle_it(
    gain: Estimate, words: str
) -> None:
    trace = replace(trace_of("effect"), gain_nlpd=gain, extended=None)
    assert answer(trace)[0] == "Weak evidence: contact friction changed 620 s into the session."
    assert [effect["weak"] for effect in trace_json(trace)["effects"]] == [True]
    assert words in worth(trace)
    assert bool(words) == bool(re.search("pushes would confirm|times as many pushes", worth(trace)))


def test_confirmed_effects_and_findings_without_a_held_out_gain_are_not_weak() -> None:
    names = ("effect", "two effects", "wrench_only", "measurement", "variance", "none")
    assert not any(trace_of(name).weak for name in names)
    assert [effect["weak"] for effect in trace_json(trace_of("two effects"))["effects"]] == [False, False]


def test_effect_that_the_refit_learns_is_weak_unless_retraining_helps() -> None:
    trace = replace(trace_of("effect"), gain_nlpd=Estimate(0.0, 0.0, 0.0), extended=None)
    held = trace.held_out
    assert not replace(trace, held_out=replace(held, refit=held.after)).weak
    assert replace(trace, held_out=replace(held, refit=held.before)).weak


def test_size_is_first_in_mm_and_deg_then_lower_or_higher() -> None:
    trace = trace_of("constant")
    friction = Sized("change of the contact friction", -0.21, -0.25, -0.17, "1")
    found = replace(trace, effects=(replace(trace.effects[0], parameter=friction),))
    metres, radians = shift_size(trace, trace.terms[0])
    mm, deg = 1e3 * metres, np.degrees(radians)
    shift = f"It shifts a window by {mm:.2g} mm and {deg:.2g} deg: contact friction 0.21 lower"
    assert answer(found)[1] == f"{shift} (95 % CI 0.17 to 0.25)."
    assert f"{shift} (95 % CI 0.17 to 0.25, p = 0.001). It explains 23 % of" in evidence(found)


def test_harmless_bias_reaches_json_and_is_no_candidate() -> None:
    bias = Sized("force read too much along x", 0.5, 0.4, 0.6, "N")
    nothing = trace_of("none")
    tested = (outcome.Tested("wrench_bias", "session", 1e-9), *nothing.tested)
    found = replace(
        nothing,
        tested=tested,
        harmless=(outcome.FoundEffect("wrench_bias", "model_inputs", (), "constant", bias, 1e-9, 0.0),),
    )
    result = trace_json(found)
    assert not result["effect_present"] and trace_json(nothing)["harmless"] == []
    assert result["harmless"] == [{"mechanism": "wrench_bias", "parameter": vars(bias)}]
    assert "The closest candidate is contact friction" in evidence(found)


# --- what no reader should see ---------------------------------------------------------------------------------------


def test_unknown_numbers_are_dashes(tmp_path: Path) -> None:
    trace = without_motion_effect(
        "wrench_only", "surface_friction", "model_inputs", Sized("force", np.nan, np.nan, np.nan, "N")
    )
    tested = (outcome.Tested(None, "velocity", float("nan")), *trace.tested)
    detectable = {
        "contact_friction": {"value": None, "unit": "1"},
        "inertia": {"value": np.float64("nan"), "unit": "1"},
    }
    broken = replace(trace, tested=tested, minimum_detectable=detectable, gain_nlpd=Estimate(np.nan, np.nan, np.nan))
    text = text_of(write_trace_report(tmp_path / "trace.html", broken).read_text())
    assert not re.search(RAW, text)


# --- sections and pictures -------------------------------------------------------------------------------------------


def test_all_candidates_are_listed_and_the_found_one_is_marked(pages: Callable[[str], str]) -> None:
    page = pages("effect")
    section = page[page.index("What else was tested") : page.index("What remains")]
    assert section.count(ROW) == len(trace_of("effect").tested) and section.count(">found<") == 1
    assert "<details open" not in page


@pytest.mark.parametrize("name", ["none", "effect", "constant", "map", "driver_only", "variance"])
def test_key_picture_names_single_pushes(pages: Callable[[str], str], name: str) -> None:
    page = pages(name)
    key = page[page.index("<svg") : page.index("<h2")]
    names = set(re.findall(r"<title>push (2-\d+): ", key))
    pushes = set(trace_of(name).analysis.pushes)
    assert names <= pushes and len(names) > 0.5 * len(pushes)


def with_columns(table: PushTable, **columns: Any) -> PushTable:
    return replace(table, covariates={**table.covariates, **columns})


def since_training() -> Trace:
    """A change since training, with which no model is extended."""
    trace = trace_of("constant")
    (effect,), (term,) = trace.effects, trace.terms
    analysis, held = (with_columns(t, session=np.ones(len(t))) for t in (trace.analysis, trace.held_out.table))
    since = replace(term, covariate="session", basis=DriverBasis("step", ("session",), place=0.5))
    named = replace(effect, covariate="session", basis="step")
    held_out = replace(trace.held_out, table=held)
    return replace(trace, effects=(named,), terms=(since,), analysis=analysis, held_out=held_out, extended=None)


def pushed_harder() -> Trace:
    trace = trace_of("wrench_only")
    training, analysis = (
        with_columns(t, normal_force=np.full(len(t), force))
        for t, force in ((trace.model.training, 1.0), (trace.analysis, 1.2))
    )
    return replace(trace, model=replace(trace.model, training=training), analysis=analysis)


def late() -> Trace:
    trace = trace_of("measurement")
    gap = -0.012 * trace.analysis.inputs[:, 0] * np.cos(trace.analysis.inputs[:, 2])
    return replace(trace, analysis=with_columns(trace.analysis, contact_gap=gap))


@pytest.mark.parametrize(
    ("trace", "shown"),
    [
        (since_training, ["Elapsed time (s)", 'class="dot push"']),
        (pushed_harder, ["Normal force (N)", "median in training", ": 1.2 N<"]),
        (late, ["Gap that the error causes", "Measured gap at the contact (mm)", "as the error predicts"]),
    ],
)
def test_key_picture_shows_what_the_finding_is_about(
    tmp_path: Path, trace: Callable[[], Trace], shown: list[str]
) -> None:
    page = write_trace_report(tmp_path / "trace.html", trace()).read_text()
    key = page[page.index("<svg") : page.index("<h2")]
    assert all(words in key for words in shown)
    if trace is late:  # which the gap follows exactly
        chart = gap_chart(late())
        assert chart is not None
        dots = next(mark for mark in chart.marks if isinstance(mark, Dots))
        np.testing.assert_allclose(dots.x, dots.y, atol=1e-9)
    if trace is since_training:
        assert sentences_of(page)[0] == "Weak evidence: contact friction differs from the model."


def test_held_out_section_shows_errors_before_and_after_and_scores_with_intervals(pages: Callable[[str], str]) -> None:
    page = pages("effect")
    section = page[page.index("Before, refit, after") : page.index("Rival explanations")]
    assert section.count('class="dot before"') == section.count('class="dot after"') > 50
    scores = re.findall(r'data-column="total">([\d.]+)<span class="interval">\[', section)
    assert len(scores) == 3 and float(scores[2]) < float(scores[0])


def test_input_shift_beside_another_verdict_is_a_warning(tmp_path: Path) -> None:
    page = write_trace_report(tmp_path / "trace.html", shifted(trace_of("effect"), "effect")).read_text()
    warning = re.search(r'<p class="warning">(.*?)</p>', page)
    assert warning and warning[1].startswith("Pushing speed is now 100 to 150 mm/s, in training 10 to 50 mm/s: 97 %")


def test_json_lists_the_input_shift() -> None:
    listed = trace_json(shifted(trace_of("effect"), "effect"))["input_shift"]
    ranges = {"training": [0.01, 0.05], "now": [0.1, 0.15]}
    assert listed == [{"covariate": "velocity", **ranges, "share_outside": 0.97, "share_unvisited": 0.0}]
    assert trace_json(trace_of("none"))["input_shift"] == []


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
    for heading in ("What else was tested", "Before, refit, after", "Coverage: share of outcomes"):
        assert heading in text
    assert "The effect" not in text
    assert nothing.comparisons[-1].model == "refit"


def test_page_accepts_fewer_windows_after_a_correction(tmp_path: Path) -> None:
    trace = without_motion_effect("measurement", "clock_offset", "model_inputs", LATE)
    held, fewer = trace.held_out, slice(0, 30)
    after = held.after
    columns = ("push_id", "mean", "covariance", "observed", "textbook")
    cut = replace(after, **{name: getattr(after, name)[fewer] for name in columns})
    text = written(
        tmp_path, replace(trace, held_out=replace(held, after=cut), find_unexplained=lambda: trace.unexplained[:90])
    )
    assert "With corrected streams the model's negative log density goes from" in text
    assert worth(replace(trace, held_out=replace(held, after=held.before))) == ""
    assert "on windows cut again" in text and "The motion was not searched" in text


def test_page_escapes_names_from_the_data(tmp_path: Path, nothing: Trace) -> None:
    tested = (outcome.Tested("<script>", "topic:/<b>", 0.5),)
    page = write_trace_report(tmp_path / "trace.html", replace(nothing, tested=tested, notes=("<i>",))).read_text()
    assert not re.search("<script>|<b>|<i>", page)


# --- sentences -------------------------------------------------------------------------------------------------------


def test_every_mechanism_and_covariate_has_a_phrase() -> None:
    assert {*CORRECTIONS, "surface_friction"} <= {*OTHERS}
    assert set(UNITS) <= set(COVARIATES)
    nouns = [mechanism.noun for mechanism in (*LIBRARY, *REFINEMENTS)]
    phrases = [*(covariate.phrase for covariate in COVARIATES.values()), *OTHERS.values(), *nouns]
    assert all(phrases) and not any("_" in phrase for phrase in phrases)


def test_intervals_show_the_digits_that_they_determine_and_no_minus_zero() -> None:
    assert interval(Estimate(0.764, 0.731, 0.802), p_value=0.001) == "0.76 (95 % CI 0.73 to 0.80, p = 0.001)"
    assert interval(Estimate(-12.04, -13.5, -10.5), "ms") == "−12.0 ms (95 % CI −13.5 to −10.5)"
    assert interval(Estimate(0.5, float("nan"), float("nan"))) == "0.5"
    assert interval(Estimate(-8.0, -13.0, -0.2)) == "−8 (95 % CI −13 to 0)"


def test_advice_matches_the_rivals() -> None:
    assert len(separating_words(["elapsed_time", "push_index"])) == 1
    assert "Return to places" in " ".join(separating_words(["slider_x", "slid_distance"]))
    assert separating_words(["topic:/a", "topic:/b"]) == [
        "Vary topic /a and topic /b independently: change one while the others stay constant."
    ]


def test_tested_candidates_are_unique_pairs_with_smallest_p_and_role(drift: Trace) -> None:
    tested = best_of([("a", "x"), ("a", "x"), (None, "x")], [0.5, 0.02, 0.1])
    assert [(t.mechanism, t.p_value) for t in tested] == [("a", 0.02), (None, 0.1)]
    roles = {(t.mechanism, t.covariate): role_of(drift, t) for t in drift.tested}
    assert roles["contact_friction", "elapsed_time"] == "found" and roles["contact_friction", "push_index"] == "rival"
    assert roles["pressure_spread", "push_index"] == ""


def test_repr_and_terminal_state_the_answer(drift: Trace) -> None:
    for trace in map(trace_of, ("none", "effect", "input_shift")):
        assert summary_lines(trace)[:4] == [*(sentence.replace("−", "-") for sentence in answer(trace)), ""]
    assert repr(drift) == "Trace of 'deployed': mechanism_only (contact_friction by elapsed_time), model extended"
    assert repr(trace_of("none")) == "Trace of 'deployed': none (no effect), model unchanged"


# --- trace figures ----------------------------------------------------------------------------------------------------


def test_key_chart_shows_the_step_of_the_effect() -> None:
    trace = trace_of("effect")
    (chart,) = basis_charts(trace, strength_of(trace.terms[0]), analysis_rows(trace))
    dots = next(mark for mark in chart.marks if isinstance(mark, Dots))
    before, after = dots.x < JUMP.place, dots.x > JUMP.place
    assert abs(np.nanmedian(dots.y[before])) < 0.03 and np.nanmedian(dots.y[after]) == pytest.approx(0.15, abs=0.03)


def test_effect_is_drawn_once_with_all_its_parameters() -> None:
    """The key picture shows the first effect's only parameter, and the noise along the covariate if it is unknown."""
    along = DriverBasis("linear", ("elapsed_time",), (500.0,), (300.0,))
    grain = made_up_trace(slippery(0.06), planted("anisotropic_friction", "elapsed_time", along, 0.1, 0.05))
    (figure,) = effect_figures(grain)
    assert figure.count('<svg class="chart') == 2
    assert "irection-dependent friction of the table against elapsed time (linear)" in figure
    assert effect_figures(trace_of("effect")) == [] == effect_figures(trace_of("driver_only"))


def test_held_out_errors_are_shown_for_each_push_before_and_after() -> None:
    trace = trace_of("effect")
    shown = trace.comparisons
    position, heading = error_charts(trace.held_out.table, "elapsed_time", [shown[0], shown[-1]])
    for chart in (position, heading):
        before, after = (mark for mark in chart.marks if isinstance(mark, Dots))
        assert len(before.x) == len(after.x) == len(trace.held_out.table.pushes)
        late = before.x > JUMP.place
        assert np.mean(before.y[late]) > 1.3 * np.mean(after.y[late])
    error = 1e3 * (shown[0].observed - shown[0].mean)[:, :2]
    square = [np.mean(np.sum(error[shown[0].push_id == push] ** 2, axis=1)) for push in np.unique(shown[0].push_id)]
    dots = next(mark for mark in position.marks if isinstance(mark, Dots))
    np.testing.assert_allclose(dots.y, np.sqrt(square))


def test_levels_of_a_covariate_are_bins_of_their_own() -> None:
    rng = np.random.default_rng(0)
    speed = np.repeat([0.01, 0.02, 0.05], [30, 90, 30]) + 1e-4 * rng.standard_normal(150)
    bins = bins_along(speed, 10)
    assert [len(np.unique(bins[part])) for part in (slice(0, 30), slice(30, 120), slice(120, 150))] == [1, 1, 1]
    assert len(np.unique(bins)) == 3 and len(np.unique(bins_along(rng.random(500), 10))) == 10


def test_bins_have_the_mean_and_an_interval_around_it() -> None:
    table = pushes(80, 4)
    bins = means_along(axis_of(table, "elapsed_time"), table.push_id, table.covariates["elapsed_time"])
    np.testing.assert_allclose(bins.place, bins.value)
    assert len(bins.place) == 10
    assert np.all((bins.low <= bins.value) & (bins.value <= bins.high))
    bars = bins.bars("before", "s", "pushes, in bins")
    assert bars.y is bins.value and bars.low is bins.low and bars.high is bins.high and " s (95 % CI " in bars.titles[0]


def test_covariate_that_is_not_recorded_gives_way_to_the_time() -> None:
    table = pushes(10, 4)
    assert axis_of(table, "model_inputs").label == "Elapsed time (s)"
    assert axis_of(replace(table, covariates={}), "model_inputs").label == "Push count"
    assert axis_of(table, "slider_heading").x.max() > 10.0  # degrees


def test_bins_follow_the_data_rather_than_a_wrong_fit() -> None:
    """A step, fitted by a line: the bins stay on the step."""
    trace = trace_of("effect")
    line = traced(trace.model, trace.analysis, trace.held_out.table, (slippery(0.1),))
    (chart,) = basis_charts(line, strength_of(line.terms[0]), analysis_rows(line))
    bins = next(mark for mark in chart.marks if isinstance(mark, Bars))
    before, after = bins.y[bins.x < 600.0], bins.y[bins.x > 650.0]
    assert after.mean() - before.mean() == pytest.approx(0.15, abs=0.04)
    assert abs(before[-1] - before[0]) < 0.4 * 0.15


def test_band_follows_the_covariance_of_the_coefficients(drift: Trace) -> None:
    strength = strength_of(drift.terms[0])
    _, half = strength.curve({"elapsed_time": np.array([500.0, 800.0])}, 2)
    np.testing.assert_allclose(half[:, 0], [0.0, 1.96 * np.sqrt(drift.terms[0].covariance[0, 0])], rtol=1e-12)


def test_single_pushes_have_the_curve_as_median(drift: Trace) -> None:
    strength, rows = strength_of(drift.terms[0]), analysis_rows(drift)
    value = per_push(strength, rows, responses(drift, strength, rows))
    place = push_means(rows.table.push_id, rows.table.covariates["elapsed_time"])[1]
    assert len(value) == len(drift.analysis.pushes)
    off = value[:, 0] - strength.curve({"elapsed_time": place}, len(place))[0][:, 0]
    assert abs(np.nanmedian(off)) < 0.02


def test_shift_is_that_of_the_windows(drift: Trace) -> None:
    twice = replace(drift.terms[0], coefficients=2.0 * drift.terms[0].coefficients)
    (metres, radians), larger = shift_size(drift, drift.terms[0]), shift_size(drift, twice)
    assert larger == pytest.approx((2.0 * metres, 2.0 * radians), rel=0.2)
    observed = drift.held_out.before.observed
    assert 0.0 < metres < 0.5 * np.hypot(*np.sqrt(np.mean(observed[:, :2] ** 2, axis=0)))
