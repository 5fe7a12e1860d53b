# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The section on modes, with repetitions that are made to have one mode or two."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from paper_studies import PLAN, made_up_corpus, made_up_grid, made_up_study, verdict_on
from push_predictor_paper.data.corpus import PushSet
from push_predictor_paper.data.repetitions import RepeatedGrid, Repetitions
from push_predictor_paper.fits.fit import Fit, trained
from push_predictor_paper.painters.histograms import moments
from push_predictor_paper.section import Section
from push_predictor_paper.sections import modality
from push_predictor_paper.sections.modality import mean_over_pushes, model_loss, section
from push_predictor_paper.statistics.modes import (
    LogDensities,
    dip,
    found_at,
    held_out,
    holm,
    log_densities,
    p_values,
    power,
    shape,
    uniform_dips,
)

from push_predictor.models.pushes import Push
from push_predictor.reporting.canvas import Picture

SPLIT = 4  # the push of the grid that is given two modes
SHOWN = replace(PLAN, repetitions=60)


def split_in_two(cell: Repetitions) -> Repetitions:
    """The same push, every other time turned by 12 sd more."""
    turned = 12.0 * cell.sd[2] * (np.arange(len(cell.outcomes)) % 2)
    return replace(cell, outcomes=cell.outcomes + turned[:, None] * [0.0, 0.0, 1.0])


def grid_with_modes(n: int = 60) -> RepeatedGrid:
    grid = made_up_grid(replace(PLAN, repetitions=n))
    cells = tuple(split_in_two(cell) if k == SPLIT else cell for k, cell in enumerate(grid.cells))
    return replace(grid, cells=cells)


def made_up_section(folder: Path, grid: RepeatedGrid) -> Section:
    return section(replace(made_up_study(folder), grids={"plywood": grid}))


@pytest.fixture(scope="module")
def with_modes(tmp_path_factory: pytest.TempPathFactory) -> Section:
    return made_up_section(tmp_path_factory.mktemp("modes"), grid_with_modes())


@pytest.mark.slow
def test_a_push_of_two_modes_is_found_and_named(with_modes: Section) -> None:
    assert verdict_on("modality", "modes", with_modes.evidence["modes"]) == "holds"
    assert with_modes.evidence["modes"].figures[0].text == f"1 of {len(grid_with_modes().seen)}"
    assert with_modes.evidence["gaussian_good"].figures[0].name == "with several modes"
    assert with_modes.tables[0].rows[2][1] == 1  # rotation


def test_no_modes_are_found_where_there_are_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(modality, "_picture", lambda *_: Picture(tmp_path, "", ""))
    made = made_up_section(tmp_path, made_up_grid(SHOWN))
    assert verdict_on("modality", "modes", made.evidence["modes"]) in ("does not hold", "not decided")
    assert "none has several modes" in made.evidence["gaussian_good"].figures[0].name


@pytest.mark.slow
def test_section_has_findings_tables_and_picture(with_modes: Section) -> None:
    for table in with_modes.tables:
        assert {len(row) for row in table.rows} == {len(table.head)}
    assert with_modes.pictures[0].path.stat().st_size > 10_000
    json.dumps(with_modes.tables[0].json(), allow_nan=False)


def test_tests_of_one_mode_and_of_a_gaussian() -> None:
    rng = np.random.default_rng(0)
    samples = rng.standard_normal((8, 100, 3))
    samples[3, :, 1] += 8.0 * (np.arange(100) % 2)
    samples[5, :, 0] = rng.exponential(size=100)
    found = shape(samples.reshape(-1, 3), np.full(8, 100))
    assert np.argwhere(found.several <= 0.05).tolist() == [[3, 1]]
    assert found.normal[3, 1] < 1e-4 and found.normal[5, 0] < 1e-4
    assert found.dip[5, 0] > 0.05
    assert found.two[3, 1] > found.one[3, 1] + 0.5
    np.testing.assert_array_equal(found.own, np.maximum(found.one, found.two))


def test_held_out_density_of_a_gaussian_is_its_entropy_and_two_do_no_better() -> None:
    values = np.random.default_rng(1).standard_normal((20, 500))
    one, two = held_out(values)
    assert one.mean() == pytest.approx(-0.5 * np.log(2.0 * np.pi * np.e), abs=0.02)
    assert two.mean() < one.mean() + 0.005


def test_held_out_density_of_two_gaussians_is_that_of_the_mixture() -> None:
    rng = np.random.default_rng(2)
    values = rng.standard_normal((5, 1000)) + 10.0 * rng.integers(0, 2, (5, 1000))
    _, two = held_out(values)
    assert two.mean() == pytest.approx(-0.5 * np.log(2.0 * np.pi * np.e) - np.log(2.0), abs=0.03)


def test_loss_is_the_difference_of_densities() -> None:
    grid = made_up_grid(PLAN)
    sizes = np.array([len(cell.outcomes) for cell in grid.seen])
    of = shape(np.concatenate([cell.outcomes for cell in grid.seen]), sizes)
    logs = [LogDensities(np.full((len(c.outcomes) + 7, 3), 2.0), np.zeros((1, 3))) for c in grid.seen]
    np.testing.assert_allclose(model_loss(grid.seen, of, logs), of.own - 2.0)


def test_densities_of_a_model_are_those_of_its_moments_and_of_its_quadrature() -> None:
    pushes: PushSet = made_up_corpus().sets[("rect1", "plywood")]
    fit, grid = Fit("vhgp", 40, "none", 0), made_up_grid()
    rows = grid.seen[3].outcomes
    inputs = np.tile(grid.typical_inputs[3], (len(rows), 1))
    found = log_densities(pushes, fit, inputs, rows)
    model = trained(pushes, fit)
    prediction = model.predict_rows(inputs, np.full(len(rows), 0.2))
    variance = np.diagonal(prediction.covariance, axis1=1, axis2=2)
    expected = -0.5 * (np.log(2.0 * np.pi * variance) + (rows - prediction.mean) ** 2 / variance)
    np.testing.assert_allclose(found.gaussian, expected, atol=1e-9)
    exact = model.predictor.exact_log_density(Push(inputs, np.full(len(rows), 0.2), {}), rows)
    assert exact is not None
    np.testing.assert_allclose(found.exact, exact)
    with pytest.raises(TypeError, match="analytical"):
        log_densities(pushes, Fit("analytical", 40, "none", 0), inputs, rows)


def test_mean_over_pushes_skips_nan() -> None:
    weights = np.array([[1.0, 1.0], [2.0, 0.0], [0.0, 2.0]])
    found = mean_over_pushes(np.array([[1.0, np.nan], [3.0, 5.0]]), weights)
    assert found.value == 3.0 and 1.0 <= found.low < found.high <= 4.0
    known = mean_over_pushes(np.array([[np.nan, np.nan], [3.0, 5.0]]), weights)
    assert (known.value, known.low, known.high) == (4.0, 4.0, 4.0)  # the draw without it is skipped


def test_a_models_density_is_shown_two_sd_wide_however_narrow_the_outcomes() -> None:
    values = np.linspace(0.9, 1.1, 50)
    mean, sd = moments(values, -0.5 * ((values - 3.0) / 2.0) ** 2 - np.log(2.0))
    assert (mean, sd) == (pytest.approx(3.0), pytest.approx(2.0))


def test_one_of_many_tests_finds_less_than_one_alone() -> None:
    corrected, single = (found_at(5.0, 60, tests, 0.05) for tests in (30, 1))
    assert 0.0 < corrected < single


def test_quantiles_of_the_uniform_equal_the_published_table() -> None:
    # Table of the R package diptest, a million samples each, n = 100 and 30; the tolerance is four standard errors.
    for n, published in ((100, [0.035462, 0.047153, 0.051128]), (30, [0.061451, 0.081479, 0.088169])):
        found = np.quantile(uniform_dips(n, 10_000), [0.5, 0.9, 0.95])
        np.testing.assert_allclose(found, published, rtol=0.02)


def test_p_values_are_uniform_for_the_uniform_and_small_for_two_modes() -> None:
    rng = np.random.default_rng(5)
    p = p_values(dip(rng.random((400, 30))), 30, 2000)
    assert np.quantile(p, 0.5) == pytest.approx(0.5, abs=0.08)
    assert 0.02 < np.mean(p <= 0.05) < 0.09
    two = dip(rng.standard_normal((1, 30)) + 20.0 * (np.arange(30) % 2))
    assert p_values(two, 30, 2000)[0] == 1.0 / 2001.0


def test_holm_equals_values_computed_by_hand() -> None:
    np.testing.assert_allclose(holm(np.array([0.04, 0.01, 0.03, 0.5])), [0.09, 0.04, 0.09, 0.5])
    assert holm(np.array([0.6, 0.7])).max() == 1.0
    assert holm(np.zeros(0)).shape == (0,)


def test_power_grows_with_the_distance_of_the_modes() -> None:
    found = [power(50, apart, 0.08, draws=200) for apart in (0.0, 3.0, 5.0, 8.0)]
    assert found == sorted(found) and found[0] < 0.05 and found[-1] > 0.95
