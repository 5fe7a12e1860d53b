# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Calibration: forecasts whose truth is known, and every verdict that the section can give."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from push_predictor_paper.claims.calibration.calibrated import EXACT, Calibrated, density_gain, fitting_size
from push_predictor_paper.claims.calibration.coverage_by_speed import coverage_by_speed, missed, speed_finding
from push_predictor_paper.claims.calibration.findings import (
    calibration_findings,
    coverage_finding,
    density_finding,
    promise,
    shape_finding,
)
from push_predictor_paper.claims.calibration.section import section
from push_predictor_paper.claims.corrected import corrected
from push_predictor_paper.data.corpus import Corpus, PushSet
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.fits.fit import Fit
from push_predictor_paper.plan import QUICK, SPEEDS
from push_predictor_paper.statistics import pit as pit_module
from push_predictor_paper.statistics.pit import BARS, Pits, coverage, exact_pit, histogram, pits, together
from push_predictor_paper.study import Study
from push_predictor_paper.work import Work
from scipy.special import ndtr

from push_predictor.evaluation.metrics import COVERAGE_LEVELS
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.evaluation.validation import Comparison
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.gaussian_process.prediction import exact_log_density
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable

PAIR = ("rect1", "plywood")
SURE = Estimate(0.95, 0.93, 0.97)
NOTHING = Corpus("simulated", "made up", {}, PAIR)


def ids(pushes: int, windows: int = 4) -> np.ndarray:
    return np.repeat([f"push{k}" for k in range(pushes)], windows)


def uniform(pushes: int, windows: int = 4, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random((pushes * windows, 3))


def outcomes(pushes: int, scatter: float = 1.0, gained: float = 0.1) -> Pits:
    """Outcomes that scatter by so much of what a standard normal forecast states; gained: nats by the exact density."""
    rng = np.random.default_rng(1)
    observed = scatter * rng.standard_normal((4 * pushes, 3))
    variance, mean = np.broadcast_to(np.eye(3), (len(observed), 3, 3)), np.zeros_like(observed)
    density = -0.5 * (np.log(2.0 * np.pi) + observed**2) + gained + 0.01 * rng.standard_normal(observed.shape)
    compared = Comparison("vhgp", 100, ids(pushes), mean, variance, observed, density, np.full(3, 0.1))
    below = np.vectorize(lambda z: 0.5 * (1.0 + float(np.sign(z)) * (1.0 - np.exp(-np.abs(z)))))(observed)
    speed = np.repeat(np.resize([0.02, 0.15, 0.4], pushes), 4)
    return Pits(compared.push_id, speed, below, below, push_scores(compared))


def rig() -> Rig:
    return Rig("rect1", shape_outline("rect1"), 0.00475, "plywood", 0.837)


def made_up_set(pushes: int = 40) -> PushSet:
    """Pushes of four windows, scattered more when fast."""
    rng = np.random.default_rng(2)
    speed = np.repeat(np.resize([0.02, 0.15, 0.4], pushes), 4)
    inputs = np.column_stack([speed, rng.uniform(0.05, 0.2, len(speed)), rng.uniform(-1.0, 1.0, len(speed))])
    moved = np.column_stack([0.2 * speed * np.cos(inputs[:, 2]), 0.02 * inputs[:, 2], 2.0 * (inputs[:, 1] - 0.125)])
    scattered = moved + 0.1 * speed[:, None] * rng.standard_normal(moved.shape) * (0.1, 0.1, 1.0)
    return PushSet(PushTable(inputs, np.full(len(inputs), 0.2), scattered, ids(pushes)), rig())


def corpus(origin: Literal["simulated", "measured"] = "simulated", pushes: int = 40) -> Corpus:
    return Corpus(origin, f"{origin}: made up", {PAIR: made_up_set(pushes)}, PAIR)


# ---- shares and histograms


def test_coverage_counts_outcomes_in_the_central_interval() -> None:
    shares = coverage(ids(2, 2), np.array([[0.5, 0.02, 0.3], [0.4, 0.98, 0.3], [0.26, 0.5, 0.9], [0.1, 0.5, 0.9]]), 0.5)
    assert [e.value for e in shares] == [0.75, 0.5, 0.5]


def test_intervals_of_coverage_resample_pushes_not_windows() -> None:
    same_within_a_push = np.repeat(uniform(60, 1), 10, axis=0)
    by_push = coverage(ids(60, 10), same_within_a_push, 0.5)[0]
    by_window = coverage(ids(600, 1), same_within_a_push, 0.5)[0]
    assert by_push.value == by_window.value
    assert by_push.high - by_push.low > 2.5 * (by_window.high - by_window.low)  # sqrt(10) = 3.2


def test_one_push_gives_a_share_without_an_interval() -> None:
    share = coverage(ids(1), np.full((4, 3), 0.5), 0.9)[0]
    assert share.value == 1.0 and np.isnan(share.low) and np.isnan(share.high)
    assert np.isnan(histogram(ids(1), np.full((4, 3), 0.5)).p).all()


def test_no_window_gives_nothing() -> None:
    assert np.isnan(coverage(ids(0), np.zeros((0, 3)), 0.9)[0].value)


def test_uniform_probabilities_do_not_reject_a_flat_histogram() -> None:
    """Of 20 made-up sets of three outputs, 5 % are wrongly rejected; more than 7 of 60 is past chance (p < 0.01)."""
    rejected = sum(int((histogram(ids(100), uniform(100, seed=s)).p <= 0.05).sum()) for s in range(20))
    assert rejected <= 7


def test_windows_that_repeat_one_push_do_not_reject_a_flat_histogram() -> None:
    repeated = [np.repeat(uniform(100, 1, seed=s), 4, axis=0) for s in range(20)]
    assert sum(int((histogram(ids(100), probabilities).p <= 0.05).sum()) for probabilities in repeated) <= 7


def test_too_wide_forecast_rejects_a_flat_histogram() -> None:
    shape = histogram(ids(200), 0.25 + 0.5 * uniform(200))
    assert (shape.p <= 0.05).all()
    assert shape.misplaced == pytest.approx(np.full(3, 0.4), abs=0.02)  # four bars hold 0.2 each instead of 0.1
    assert shape.shares.sum(axis=0) == pytest.approx(np.ones(3))
    assert shape.shares.shape == (BARS, 3)


def test_a_probability_of_one_lies_in_the_last_bar() -> None:
    assert histogram(ids(2, 1), np.array([[1.0, 0.0, 0.5]] * 2)).shares[-1].tolist() == [1.0, 0.0, 0.0]


def test_the_exact_transform_is_the_distribution_function_of_the_exact_density() -> None:
    pushes, options = made_up_set(), TrainingOptions(n_train=60, mean="zero", per_path=False, tails=False)
    model = train_model(pushes.table, pushes.rig, "vhgp", name="v", options=options)
    table, k = pushes.table.take(np.arange(1)), 1
    latent, scaling = model.predictor.latent(table.inputs)[k], model.predictor.scaling
    scaled = float((table.outcomes[0, k] - scaling.outcome_mean[k]) / scaling.outcome_sd[k])
    sd = float(np.sqrt(latent.outcome_variance[0]))
    below = np.linspace(min(scaled, float(latent.mean[0])) - 15.0 * sd, scaled, 10_001)
    repeated = replace(latent, **{name: np.repeat(value, len(below)) for name, value in vars(latent).items()})
    density = np.exp(exact_log_density(repeated, below))
    assert exact_pit(model, table)[0, k] == pytest.approx(np.trapezoid(density, below), abs=1e-6)


@pytest.mark.parametrize("kind", ["analytical", "gp"])
def test_where_the_predictive_is_gaussian_both_transforms_agree(kind: str) -> None:
    found = pits(made_up_set(), Fit(kind, 50, "push", 0))
    assert found.exact == pytest.approx(found.gaussian, abs=1e-9)


def test_together_joins_the_windows_of_several_folds() -> None:
    folds = [pits(made_up_set(), Fit("gp", 30, "push", fold)) for fold in range(5)]
    whole = together(folds)
    assert len(whole.push_id) == 160 and len(whole.push_scores.push_id) == 40
    assert whole.gaussian.shape == whole.exact.shape == (160, 3) and len(whole.speed) == 160


# ---- verdicts


def test_state_of_an_output_is_kept_broken_or_open() -> None:
    kept = [Estimate(0.5, 0.45, 0.55), Estimate(0.9, 0.88, 0.93), SURE]
    assert promise(kept) == "kept"
    assert promise([Estimate(0.5, 0.35, 0.65), *kept[1:]]) == "open"
    assert promise([*kept[:2], Estimate(0.9, 0.85, 0.93)]) == "broken"
    assert promise([Estimate(0.7, 0.55, 0.85), *kept[1:]]) == "open"  # nine intervals are asked together
    assert promise([Estimate(0.75, 0.65, 0.85), *kept[1:]]) == "broken"


def test_nine_corrected_intervals_jointly_cover_as_often_as_one() -> None:
    """Of 1000 made-up sets of nine figures each, at least 940 have all nine within their corrected intervals."""
    figures = np.random.default_rng(0).standard_normal((1000, 9))
    wide = corrected(Estimate(0.0, -1.96, 1.96), 9)
    assert 940 <= int((np.abs(figures) <= wide.high).all(axis=1).sum()) <= 970
    assert corrected(SURE, 1).text(".6f") == SURE.text(".6f")


@pytest.mark.long
def test_a_perfect_gaussian_model_is_seldom_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    """900 pushes of 4 windows, predicted as they were drawn, the outcomes of a push alike: at most 10 % rejected."""
    drawn = push_bootstrap(ids(900, 1))
    monkeypatch.setattr(pit_module, "push_bootstrap", lambda _: drawn)  # the draws are the same each time, and slow
    broken = 0
    for run in range(60):
        rng = np.random.default_rng(run)
        shared, own = rng.standard_normal((900, 1, 3)), rng.standard_normal((900, 4, 3))
        transformed = ndtr(np.sqrt(0.5) * (shared + own)).reshape(-1, 3)
        by_level = [coverage(ids(900), transformed, level) for level in COVERAGE_LEVELS]
        broken += any(promise([level[k] for level in by_level]) != "kept" for k in range(3))
    assert broken <= 6


def found(outputs: list[str], p: list[float], gains: tuple[Estimate, Estimate], pushes: int = 200) -> Calibrated:
    """Results of which each output keeps, breaks or leaves open its promise."""
    levels = (0.5, 0.9, 0.95)
    spans = {"kept": (-0.03, 0.03), "broken": (-0.09, -0.05), "open": (-0.2, 0.2)}
    coverages = [[Estimate(level, level + spans[o][0], level + spans[o][1]) for o in outputs] for level in levels]
    judged = {("vhgp", split): outcomes(pushes) for split in ("push", "random")}
    shape = replace(histogram(ids(pushes), uniform(pushes)), p=np.array(p))
    shown = [(model, "push") for model in ("GP", EXACT)]
    return Calibrated(
        NOTHING, 100, judged, dict.fromkeys(shown, coverages), dict.fromkeys(shown, shape),
        dict(zip(("push", "random"), gains, strict=True)),
    )  # fmt: skip


BETTER, SAME, WORSE = Estimate(-0.2, -0.3, -0.1), Estimate(0.0, -0.1, 0.1), Estimate(0.2, 0.1, 0.3)


@pytest.mark.parametrize(
    ("outputs", "verdict"),
    [
        (["kept", "kept", "kept"], "holds"),
        (["kept", "broken", "kept"], "holds in part"),
        (["kept", "broken", "open"], "holds in part"),
        (["broken", "broken", "broken"], "does not hold"),
        (["kept", "open", "kept"], "not decided"),
        (["open", "open", "open"], "not decided"),
    ],
)
def test_interval_claim_holds_if_every_output_is_kept(outputs: list[str], verdict: str) -> None:
    finding = coverage_finding(found(outputs, [0.5] * 3, (SAME, SAME)), EXACT)
    assert finding.verdict == verdict
    assert "800 windows of 200 pushes" in finding.sentence and "0.950" in finding.sentence


@pytest.mark.parametrize(
    ("p", "pushes", "verdict"),
    [
        ([0.2, 0.3, 0.06], 200, "holds"),
        ([0.2, 0.03, 0.06], 200, "holds"),
        ([0.2, 0.01, 0.06], 200, "holds in part"),
        ([0.01, 0.01, 0.015], 200, "does not hold"),
        ([0.2, 0.3, 0.06], 59, "not decided"),
        ([0.01, 0.01, 0.01], 59, "does not hold"),
    ],
)
def test_shape_claim_holds_if_no_histogram_is_rejected(p: list[float], pushes: int, verdict: str) -> None:
    assert shape_finding(found(["kept"] * 3, p, (SAME, SAME), pushes)).verdict == verdict


@pytest.mark.parametrize(
    ("gains", "verdict"),
    [
        ((BETTER, BETTER), "holds"),
        ((SAME, BETTER), "holds in part"),
        ((BETTER, WORSE), "holds in part"),
        ((WORSE, SAME), "does not hold"),
        ((SAME, SAME), "not decided"),
    ],
)
def test_the_exact_density_must_gain_on_both_splits(gains: tuple[Estimate, Estimate], verdict: str) -> None:
    finding = density_finding(found(["kept"] * 3, [0.5] * 3, gains))
    assert finding.verdict == verdict
    assert gains[0].text("+.3f") in finding.sentence


def test_four_findings_a_corpus() -> None:
    findings = calibration_findings(found(["kept"] * 3, [0.5] * 3, (SAME, SAME)))
    assert len(findings) == 4 and {finding.origin for finding in findings} == {"beyond the paper"}


def test_the_gain_of_a_density_is_its_mean_over_windows_summed_over_outputs() -> None:
    gain = density_gain(outcomes(100, gained=0.1))
    assert gain.value == pytest.approx(-0.3, abs=0.01)
    assert gain.low < gain.value < gain.high < 0.0


# ---- coverage by speed


def misjudged(windows: Pits, speed: float) -> Pits:
    """The same windows, those of a speed all far out."""
    probabilities = np.where(windows.speed[:, None] == speed, 0.001, windows.gaussian)
    return replace(windows, gaussian=probabilities, exact=probabilities)


def uniform_pits(pushes: int) -> Pits:
    """Coverage exactly 95 % in every group of speeds, spread evenly over pushes of twenty windows."""
    even = np.tile(np.r_[0.001, np.linspace(0.05, 0.95, 19)], pushes)
    speed = np.repeat(np.resize([0.02, 0.15, 0.4], pushes), 20)
    probabilities = np.column_stack([even] * 3)
    return Pits(ids(pushes, 20), speed, probabilities, probabilities, outcomes(2).push_scores)


def test_speeds_fall_into_three_groups_with_all_windows_in_one() -> None:
    windows = uniform_pits(30)
    groups = coverage_by_speed(SPEEDS, windows, windows)
    assert [(g.name, g.span) for g in groups] == [
        ("slow", "10 to 75 mm/s"),
        ("medium", "100 to 200 mm/s"),
        ("fast", "300 to 500 mm/s"),
    ]
    assert coverage_by_speed(SPEEDS[:3], windows, windows)[2].span == "50 mm/s"
    assert [(g.windows, g.pushes) for g in groups] == [(200, 10)] * 3


def test_cells_that_miss_their_level_are_named() -> None:
    groups = coverage_by_speed(SPEEDS, misjudged(uniform_pits(30), 0.4), uniform_pits(30))
    assert [cell.split(" 0.")[0] for cell in missed(groups, "GP")] == ["fast dx", "fast dy", "fast dtheta"]
    assert missed(groups, EXACT) == []


def test_speed_claim_holds_if_only_one_noise_level_misses() -> None:
    groups = coverage_by_speed(SPEEDS, misjudged(uniform_pits(30), 0.4), uniform_pits(30))
    finding = speed_finding(groups)
    assert finding.verdict == "holds" and "The GP misses 0.95 in 3 cells" in finding.sentence


def test_speed_claim_holds_in_part_if_some_cells_of_the_vhgp_miss_too() -> None:
    worst = misjudged(misjudged(uniform_pits(30), 0.4), 0.15)
    assert speed_finding(coverage_by_speed(SPEEDS, worst, misjudged(uniform_pits(30), 0.4))).verdict == (
        "holds in part"
    )


def test_speed_claim_does_not_hold_if_both_miss_as_often() -> None:
    wrong = misjudged(uniform_pits(30), 0.4)
    assert speed_finding(coverage_by_speed(SPEEDS, wrong, wrong)).verdict == "does not hold"


def test_speed_claim_does_not_hold_if_no_cell_misses() -> None:
    right = uniform_pits(30)
    assert speed_finding(coverage_by_speed(SPEEDS, right, right)).verdict == "does not hold"


def test_speed_claim_is_not_decided_with_an_empty_group() -> None:
    right = uniform_pits(30)
    slow = replace(right, speed=np.full(len(right.speed), 0.02))
    groups = coverage_by_speed(SPEEDS, slow, slow)
    assert [g.windows for g in groups] == [600, 0, 0]
    assert speed_finding(groups).verdict == "not decided"


# ---- the section


def study(tmp_path: Path, simulated: Corpus, *measured: Corpus) -> Study:
    return Study(
        replace(QUICK, sizes=(20,), seeds=1), Work(tmp_path / "work", cores=1), tmp_path, simulated, measured, {}
    )


def test_a_set_too_small_for_the_plan_gets_a_note(tmp_path: Path) -> None:
    small = corpus("measured", pushes=5)
    assert fitting_size(study(tmp_path, small), small) is None
    made = section(study(tmp_path, small))
    assert made.findings == () and made.tables == ()
    assert any("too few windows" in note for note in made.notes)
