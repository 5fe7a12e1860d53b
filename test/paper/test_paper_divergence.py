# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The KL section on made-up pushes whose distribution is a formula."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from paper_studies import PLAN, made_up_corpus, made_up_grid, made_up_study, truth
from push_predictor_paper.claims.divergence.models import trainings
from push_predictor_paper.claims.divergence.rules import divergences, estimate, good, lower
from push_predictor_paper.claims.divergence.section import section
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.fits.fit import Answer
from push_predictor_paper.section import Section
from push_predictor_paper.statistics.grid_maps import block_weights, mean_of, median_of

from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.types import Array

MANY = replace(PLAN, repetitions=400)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Section:
    return section(made_up_study(tmp_path_factory.mktemp("divergence")))


def answer(inputs: Array, wider: float = 1.0, off: float = 0.0) -> Answer:
    mean, sd = truth(inputs)
    return Answer(mean + off * sd, wider * sd, wider * sd, np.ones(len(mean), dtype=np.bool_))


def test_the_truth_has_next_to_no_divergence_and_a_wider_model_a_known_one() -> None:
    grid = made_up_grid(MANY)
    found = divergences(grid, [answer(grid.typical_inputs), answer(grid.typical_inputs, wider=2.0, off=1.0)])
    assert found.correct.shape == (2, len(grid.seen))
    assert found.correct[0].mean() == pytest.approx(0.0075, abs=0.003)
    assert found.correct[1].mean() == pytest.approx(3.0 * (np.log(2.0) + 0.125 + 0.125 - 0.5), abs=0.05)
    assert found.of_mean[1].mean() == pytest.approx(3.0 * 0.125, abs=0.03)
    assert found.printed[1].mean() == pytest.approx(found.correct[1].mean() - 1.5 * np.log(2.0), abs=0.02)
    np.testing.assert_allclose(found.of_sd + found.of_mean, found.correct)
    assert np.median(found.sd_ratio[1]) == pytest.approx(2.0, abs=0.05)


def test_estimate_is_the_mean_over_seeds_with_resampled_pushes() -> None:
    values = np.array([[1.0, 2.0, 9.0], [3.0, 4.0, 5.0]])
    weights = push_bootstrap(np.arange(3))
    assert estimate(values, mean_of, weights).value == 4.0
    assert estimate(values, median_of, weights).value == 3.0
    found = estimate(values, mean_of, weights)
    assert (found.low, found.high) == (pytest.approx(2.0), pytest.approx(7.0))


def test_pushes_that_are_alike_in_blocks_leave_a_wider_interval_than_independent_ones() -> None:
    grid = made_up_grid(replace(PLAN, contacts=11, angle_step=0.2, repetitions=12))
    block = np.array([np.floor(cell.fraction / 0.2 + 1e-9) + np.floor(cell.angle / 0.4 + 1e-9) for cell in grid.seen])
    weights = (block_weights(grid.seen), push_bootstrap(np.arange(len(block))))
    blocks, single = (estimate(block[None], mean_of, w) for w in weights)
    assert blocks.high - blocks.low > 1.4 * (single.high - single.low)
    np.testing.assert_array_equal(divergences(grid, [answer(grid.typical_inputs)]).weights, weights[0])


def test_difference_resamples_the_same_pushes_for_both() -> None:
    values = np.random.default_rng(0).gamma(1.0, size=(2, 30))
    difference = estimate(values, mean_of, push_bootstrap(np.arange(30)), values + 1.0)
    assert (difference.low, difference.high) == (pytest.approx(-1.0), pytest.approx(-1.0))


@pytest.mark.parametrize(
    ("ends", "below", "verdict"),
    [
        ((-2.0, -1.0), 5, "holds"),
        ((-2.0, -1.0), 4, "holds in part"),
        ((-1.0, 1.0), 5, "not decided"),
        ((1.0, 2.0), 0, "does not hold"),
        ((np.nan, np.nan), 0, "not decided"),
    ],
)
def test_verdicts_on_a_difference(ends: tuple[float, float], below: int, verdict: str) -> None:
    assert lower(Estimate(float(np.mean(ends)), *ends), below, 5) == verdict


@pytest.mark.parametrize(
    ("ends", "verdict"),
    [((0.1, 0.9), "holds"), ((0.5, 2.0), "holds in part"), ((1.0, 5.0), "not decided"), ((3.0, 5.0), "does not hold")],
)
def test_verdicts_on_the_median(ends: tuple[float, float], verdict: str) -> None:
    assert good(Estimate(float(np.mean(ends)), *ends)) == verdict


@pytest.mark.long
def test_section_has_the_papers_figures_next_to_ours(made: Section) -> None:
    rows = {row[0]: row for row in made.tables[0].rows}
    assert rows["GP"][-2:] == ("22.63", "5.74") and rows["VHGP"][-2:] == ("15.32", "5.34")
    assert len({len(row) for row in (made.tables[0].head, *made.tables[0].rows)}) == 1
    assert [finding.claim.split()[-2:] for finding in made.findings[:2]] == [["mean", "KL"], ["median", "KL"]]
    assert all(picture.path.stat().st_size > 10_000 and picture.alt for picture in made.pictures)
    json.dumps(made.data, allow_nan=False)


def test_trains_on_the_grids_speed_alone_if_there_are_enough_windows(tmp_path: Path) -> None:
    few = made_up_study(tmp_path)
    assert [t.name for t in trainings(few)] == ["all speeds"]
    slow = replace(few, simulated=made_up_corpus(40, 3, speeds=(0.02, 0.3)))
    every, as_few, alone = trainings(slow)
    assert every.n == PLAN.size and as_few.n == alone.n == min(48, PLAN.size)
    assert len(alone.pushes.table) == 60
    np.testing.assert_allclose(alone.pushes.table.inputs[:, 0], 0.02, rtol=0.2)


def test_grid_with_too_few_repetitions_is_not_decided(tmp_path: Path) -> None:
    study = made_up_study(tmp_path)
    unseen = made_up_grid(replace(PLAN, repetitions=3))
    made = section(replace(study, grids={"plywood": unseen}))
    assert [finding.verdict for finding in made.findings] == ["not decided"]
    assert made.tables == ()
