# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The KL divergence against its definition, and its section on made-up pushes whose distribution is a formula."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from paper_studies import PLAN, made_up_grid, made_up_study, truth, verdict_on
from push_predictor_paper.fits.fit import Answer
from push_predictor_paper.section import Section
from push_predictor_paper.sections.divergence import (
    divergences,
    estimate,
    expected_kl,
    gaussian_kl,
    nearer,
    printed_kl,
    section,
)
from push_predictor_paper.statistics.grid_maps import block_weights, mean_of, median_of
from scipy.integrate import quad

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
    assert found.printed[1].mean() == pytest.approx(found.correct[1].mean() - 1.5 * np.log(2.0), abs=0.02)


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


@pytest.mark.parametrize("name", ["mean", "median"])
def test_the_nearer_model_has_the_smaller_divergence(name: str) -> None:
    grid = made_up_grid(MANY)
    near, far = (divergences(grid, [answer(grid.typical_inputs, wider)]) for wider in (1.0, 2.0))
    assert verdict_on("divergence", name, nearer(name, {"vhgp": near, "gp": far})) == "holds"
    assert verdict_on("divergence", name, nearer(name, {"vhgp": far, "gp": near})) == "does not hold"


def test_difference_resamples_the_same_pushes_for_both() -> None:
    values = np.random.default_rng(0).gamma(1.0, size=(2, 30))
    difference = estimate(values, mean_of, push_bootstrap(np.arange(30)), values + 1.0)
    assert (difference.low, difference.high) == (pytest.approx(-1.0), pytest.approx(-1.0))


@pytest.mark.long
def test_section_has_the_papers_figures_next_to_ours(made: Section) -> None:
    rows = {row[0]: row for row in made.tables[0].rows}
    assert rows["GP"][-2:] == ("22.63", "5.74") and rows["VHGP"][-2:] == ("15.32", "5.34")
    assert len({len(row) for row in (made.tables[0].head, *made.tables[0].rows)}) == 1
    assert [*made.evidence] == ["mean", "median", "good"]
    assert all(picture.path.stat().st_size > 10_000 and picture.alt for picture in made.pictures)
    json.dumps(made.tables[0].json(), allow_nan=False)


ZERO, ONE = np.zeros(1), np.ones(1)


def log_density(y: float, mean: float, sd: float) -> float:
    return -0.5 * ((y - mean) / sd) ** 2 - np.log(sd) - 0.5 * np.log(2.0 * np.pi)


def kl_by_integration(mean: float, sd: float, model_mean: float, model_sd: float) -> float:
    def integrand(y: float) -> float:
        log_p = log_density(y, mean, sd)
        return float(np.exp(log_p) * (log_p - log_density(y, model_mean, model_sd)))

    ends = mean + sd * np.arange(-14, 15)
    return sum(quad(integrand, end, end + sd, epsabs=1e-14, epsrel=1e-13)[0] for end in ends[:-1])


@pytest.mark.parametrize(
    "case", [(0.0, 1.0, 0.0, 1.0), (0.3, 0.5, -0.2, 1.7), (1.0, 2.0, 0.5, 0.9), (0.0, 1.0, 3.0, 1.0)]
)
def test_kl_equals_the_integral_of_its_definition(case: tuple[float, float, float, float]) -> None:
    closed = float(gaussian_kl(*(np.array(v) for v in case)))
    assert closed == pytest.approx(kl_by_integration(*case), rel=1e-12, abs=1e-12)


def test_kl_is_zero_for_equal_gaussians_and_positive_otherwise() -> None:
    rng = np.random.default_rng(0)
    mean, sd, other, other_sd = (
        rng.normal(size=99),
        rng.gamma(2.0, size=99),
        rng.normal(size=99),
        rng.gamma(2.0, size=99),
    )
    np.testing.assert_array_equal(gaussian_kl(mean, sd, mean, sd), np.zeros(99))
    assert (gaussian_kl(mean, sd, other, other_sd) > 0.0).all()


def test_printed_formula_is_that_of_the_paper_and_not_a_divergence() -> None:
    mean, sd, model_mean, model_sd = 0.3, 0.5, -0.2, 1.7
    paper = 0.5 * (np.log(model_sd / sd) + (sd**2 + (mean - model_mean) ** 2) / model_sd**2 - 1.0)
    assert printed_kl(*(np.array(v) for v in (mean, sd, model_mean, model_sd))) == pytest.approx(paper, abs=1e-15)
    lowest = printed_kl(ZERO, ONE, ZERO, np.sqrt(2.0) * ONE)[0]
    assert lowest == pytest.approx(-0.0767, abs=1e-4)


@pytest.mark.parametrize("n", [10, 100])
def test_expected_kl_of_the_true_distribution(n: int) -> None:
    draws = np.random.default_rng(n).standard_normal((40_000, n))
    kl = gaussian_kl(draws.mean(axis=1), draws.std(axis=1, ddof=1), ZERO, ONE)
    assert kl.mean() == pytest.approx(expected_kl(n), abs=4.0 * kl.std() / 200.0)
