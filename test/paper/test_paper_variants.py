# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Other kernels: the rule by which one becomes the default, and every verdict that the section can give."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from push_predictor_paper.claims.learning import variants as claim
from push_predictor_paper.claims.learning.variant_rules import (
    OTHERS,
    REPORTED,
    Variants,
    accepted,
    gain_finding,
    rule_finding,
)
from push_predictor_paper.data.corpus import Corpus, PushSet
from push_predictor_paper.fits import variants as jobs
from push_predictor_paper.fits.fit import SPLITS, Fit, Score, score
from push_predictor_paper.fits.variants import CHOICES, PLAIN, score_variant, variant_fits
from push_predictor_paper.plan import FULL, QUICK
from push_predictor_paper.study import Study
from push_predictor_paper.work import Work

from push_predictor.evaluation.push_scores import PushScores
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.gaussian_process.kernels import DEFAULT_CHOICE
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable

PAIR = ("rect1", "plywood")
NUGGET, MATERN = OTHERS[0], OTHERS[1]


def corpus(pushes: int = 60, origin: Literal["simulated", "measured"] = "simulated") -> Corpus:
    """A smooth law with a scatter that grows with the angle; four windows a push."""
    rng = np.random.default_rng(0)
    rows = 4 * pushes
    inputs = np.column_stack([rng.uniform(0.02, 0.1, rows), rng.uniform(0.05, 0.2, rows), rng.uniform(-1, 1, rows)])
    moved = np.column_stack([0.2 * inputs[:, 0], 0.01 * np.sin(2.0 * inputs[:, 2]), 2.0 * (inputs[:, 1] - 0.125)])
    scatter = (0.1 + np.abs(inputs[:, 2:])) * rng.standard_normal((rows, 3)) * (2e-3, 2e-3, 0.05)
    table = PushTable(inputs, np.full(rows, 0.2), moved + scatter, np.repeat([f"push{k}" for k in range(pushes)], 4))
    rig = Rig("rect1", shape_outline("rect1"), 0.00475, "plywood", 0.837)
    return Corpus(origin, f"{origin}: made up", {PAIR: PushSet(table, rig)}, PAIR)


def scored(nlpd: float, nmse: float = 0.2, pushes: int = 50, noise: float = 0.02) -> PushScores:
    """A push_scores with that exact NLPD by output, a little different from push to push."""
    jitter = noise * np.random.default_rng(abs(int(1000 * nlpd))).standard_normal((pushes, 3))
    rows = np.ones((pushes, 3))
    density = nlpd * rows + jitter - jitter.mean(axis=0)
    covered = np.ones((pushes, 3, 3))
    return PushScores(np.arange(pushes).astype(str), np.ones(pushes), nmse * rows, rows, density, density, covered)


def made_up(gains: dict[tuple[int, str, str], float], noise: float = 0.02, nmse: float = 0.2) -> Variants:
    """Gains in exact NLPD by output over the plain kernel, by size, split and kernel; 0 where not given."""
    sizes = sorted({n for n, _, _ in gains} | {500})
    scores = {
        (n, split, name): scored(-4.0 - gains.get((n, split, name), 0.0), 0.2 if name == PLAIN else nmse, noise=noise)
        for n in sizes
        for split in SPLITS
        for name in CHOICES
    }
    return Variants(corpus(), scores, dict.fromkeys(scores, 1.0), dict.fromkeys(scores, 5))


def on_both(name: str, gain: float, n: int = 500) -> dict[tuple[int, str, str], float]:
    return {(n, split, name): gain for split in SPLITS}


# ---- the rule


def test_a_variant_better_on_both_splits_is_accepted() -> None:
    assert accepted(made_up(on_both(MATERN, 0.05))) == [MATERN]


def test_the_best_by_push_is_named_first() -> None:
    assert accepted(made_up(on_both(MATERN, 0.05) | on_both(REPORTED, 0.09))) == [REPORTED, MATERN]


def test_a_gain_on_the_random_split_alone_does_not_suffice() -> None:
    assert accepted(made_up({(500, "random", MATERN): 0.05})) == []


def test_a_gain_by_push_alone_does_not_suffice() -> None:
    assert accepted(made_up({(500, "push", MATERN): 0.05})) == []


def test_a_loss_at_a_smaller_size_rejects_the_variant() -> None:
    assert accepted(made_up(on_both(MATERN, 0.05) | {(100, "push", MATERN): -0.05})) == []


def test_a_worse_mean_rejects_the_variant() -> None:
    assert accepted(made_up(on_both(MATERN, 0.05), nmse=0.3)) == []
    assert accepted(made_up(on_both(MATERN, 0.05), nmse=0.1)) == [MATERN]


def test_a_gain_within_its_interval_does_not_suffice() -> None:
    assert accepted(made_up(on_both(MATERN, 0.001), noise=0.5)) == []


# ---- verdicts


@pytest.mark.parametrize(
    ("gains", "noise", "verdict"),
    [
        (on_both(NUGGET, 0.05), 0.02, "holds"),
        ({(500, "random", NUGGET): 0.05}, 0.02, "holds in part"),
        ({(500, split, name): -0.05 for split in SPLITS for name in OTHERS}, 0.02, "does not hold"),
        (on_both(NUGGET, -0.05), 0.5, "not decided"),
    ],
)
def test_default_changes_only_by_the_rule(gains, noise: float, verdict: str) -> None:
    assert rule_finding(made_up(gains, noise)).verdict == verdict


def test_the_rule_names_what_it_accepts_and_what_the_random_split_would() -> None:
    sentence = rule_finding(made_up(on_both(NUGGET, 0.05) | {(500, "random", MATERN): 0.05})).sentence
    assert f"Accepted: {NUGGET}." in sentence
    assert f"The random split alone would accept {MATERN} too." in sentence


@pytest.mark.parametrize(
    ("gains", "stated"),
    [
        ({}, "would accept none."),
        (on_both(NUGGET, 0.05), "would accept no other."),
        ({(500, "random", MATERN): 0.05}, f"would accept {MATERN} instead."),
    ],
)
def test_states_which_variants_the_random_split_alone_accepts(gains, stated: str) -> None:
    assert stated in rule_finding(made_up(gains)).sentence


def test_gain_interval_is_widened_for_three_variants() -> None:
    """An interval that ends just below zero by itself, and not once it is widened."""
    gain = made_up(on_both(MATERN, 0.002), noise=0.01).gain(500, "push", MATERN)
    half = (gain.high - gain.low) / 2.0
    for factor, chosen in ((1.1, []), (1.4, [MATERN])):  # Bonferroni of three: 1.22
        sure = made_up(on_both(MATERN, 0.002), noise=0.01 * abs(gain.value) / (factor * half))
        assert sure.gain(500, "push", MATERN).high < 0.0
        assert accepted(sure) == chosen


def test_states_fewer_folds_at_the_largest_size() -> None:
    found = made_up(on_both(MATERN, 0.05) | {(1000, "push", MATERN): 0.05})
    fewer = replace(found, fits={cell: 3 if cell[0] == 1000 else 5 for cell in found.fits})
    assert "3 folds at 1000 windows (of 5 at smaller sizes)" in rule_finding(fewer).sentence


@pytest.mark.parametrize(
    ("small", "large", "noise", "verdict"),
    [
        (0.05, 0.05, 0.02, "holds"),
        (-0.05, 0.05, 0.02, "holds in part"),
        (-0.05, -0.05, 0.02, "does not hold"),
        (0.001, -0.001, 0.5, "not decided"),
    ],
)
def test_the_gain_that_others_report_must_survive_at_every_size(
    small: float, large: float, noise: float, verdict: str
) -> None:
    found = made_up({(100, "push", REPORTED): small, (500, "push", REPORTED): large}, noise)
    finding = gain_finding(found)
    assert finding.verdict == verdict and finding.origin == "beyond the paper"
    assert found.gain(100, "push", REPORTED).text("+.3f") in finding.sentence


def test_differences_are_paired() -> None:
    """What makes a push hard for both kernels is no part of the interval of their difference."""
    hard = np.random.default_rng(3).standard_normal((50, 1))
    plain, other = (replace(t, exact_nlpd=t.exact_nlpd + hard) for t in (scored(-4.0), scored(-4.05)))
    found = Variants(corpus(), {(500, "push", PLAIN): plain, (500, "push", MATERN): other}, {}, {})
    gain = found.gain(500, "push", MATERN)
    assert gain.value == pytest.approx(-0.15)
    assert gain.high - gain.low < 0.1


# ---- the fits


def test_sizes_are_those_that_plan_and_set_reach() -> None:
    few, many = corpus(60), corpus(300)
    assert {fit.n for fit in variant_fits(FULL, few)} == {100}
    assert {fit.n for fit in variant_fits(FULL, many)} == {100, 500}
    assert {fit.n for fit in variant_fits(QUICK, many)} == {100}


def test_large_fits_are_made_for_three_seeds_only() -> None:
    fits = variant_fits(FULL, corpus(500))
    assert sorted({fit.seed for fit in fits if fit.n == 1000}) == [0, 1, 2]
    assert sorted({fit.seed for fit in fits if fit.n == 500}) == [0, 1, 2, 3, 4]


def test_the_default_choice_is_scored_like_every_other_fit() -> None:
    pushes, fit = corpus().sets[PAIR], Fit("vhgp", 40, "push", 1)
    assert score_variant(pushes, fit, DEFAULT_CHOICE).exact_nlpd == pytest.approx(score(pushes, fit).exact_nlpd)


def test_the_choice_reaches_the_model() -> None:
    pushes, fit = corpus().sets[PAIR], Fit("vhgp", 40, "push", 0)
    scores = [float(score_variant(pushes, fit, choice).exact_nlpd.sum()) for choice in CHOICES.values()]
    assert len(set(scores)) == len(CHOICES)


def test_all_kernels_are_scored_on_the_same_windows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jobs, "SIZES", (30,))
    found = jobs.variant_scores(replace(QUICK, seeds=1), Work(tmp_path, cores=1), corpus(20))
    assert {name for name, _ in found} == set(CHOICES)
    for split in SPLITS:
        scores = [found[name, Fit("vhgp", 30, split, 0)].push_scores for name in CHOICES]
        assert all(np.array_equal(t.push_id, scores[0].push_id) for t in scores)
        assert all(np.array_equal(t.windows, scores[0].windows) for t in scores)


def test_scores_of_folds_are_pooled() -> None:
    fits = [Fit("vhgp", 100, "push", fold) for fold in range(2)]
    parts = [replace(scored(-4.0), push_id=np.array([f"{k} of {fold}" for k in range(50)])) for fold in range(2)]
    made = {(PLAIN, fit): Score(fit, part, 2.0 + fit.seed) for fit, part in zip(fits, parts, strict=True)}
    found = Variants.of(corpus(), made)
    cell = (100, "push", PLAIN)
    assert len(found.scores[cell].push_id) == 100
    assert found.cpu[cell] == 2.5 and found.fits[cell] == 2


# ---- the section


@pytest.mark.long
def test_a_section_has_table_and_picture_and_a_note_for_a_set_too_small(tmp_path: Path) -> None:
    study = Study(
        replace(QUICK, seeds=1), Work(tmp_path / "work", cores=1), tmp_path, corpus(), (corpus(10, "measured"),), {}
    )
    made = claim.section(study)
    assert len(made.findings) == 2 and len(made.tables) == 1
    assert [p.path for p in made.pictures] == [tmp_path / "variants_0.png"] and made.pictures[0].path.is_file()
    assert any("measured: made up" in note and "100 training windows" in note for note in made.notes)
    assert all(len(row) == len(made.tables[0].head) for row in made.tables[0].rows)
    assert len(made.tables[0].rows) == 2 * len(CHOICES)
    json.dumps(made.data, allow_nan=False)
