# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The data that the paper's claims are computed from: recordings made on demand, windows cut, repetitions counted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from paper_studies import PLAN, made_up_corpus, made_up_grid, made_up_study, verdict_on
from push_predictor_paper.data.corpus import Corpus, PushSet, learning_set, learning_spec, pair_number, travel_for
from push_predictor_paper.data.repetitions import FEWEST, grid_spec, repeat_push
from push_predictor_paper.plan import FULL, QUICK
from push_predictor_paper.section import TooFewError
from push_predictor_paper.sections import divergence, maps, modality, noise
from push_predictor_paper.sections.data import fewest_windows, known, section

from push_predictor.recordings.load import load_data
from push_predictor.simulation.rig_simulator import SimulationSpec

GRID = made_up_grid(replace(PLAN, contacts=11, angle_step=0.75, repetitions=100))


def test_the_full_plan_is_of_the_papers_size() -> None:
    assert len(FULL.pairs) == 16 and FULL.pairs[0] == ("rect1", "plywood")
    assert len(FULL.speeds) >= 8 and FULL.speeds[0] == 0.01 and FULL.speeds[-1] == 0.5
    assert len(FULL.grid_fractions) == 11 and FULL.repetitions == 100
    np.testing.assert_allclose(np.diff(FULL.grid_angles), 0.1)
    assert FULL.grid_angles[0] == -1.5 and FULL.grid_angles[-1] == 1.5
    assert FULL.sizes == (10, 20, 50, 100, 200, 500, 1000) and FULL.largest == 2000


def test_every_speed_has_as_many_pushes_each_long_enough_for_a_window() -> None:
    pushes = learning_spec(FULL, "ellip2", "pu").pushes
    counts = [int(np.sum(pushes.speed == speed)) for speed in FULL.speeds]
    assert set(counts) == {FULL.pushes // len(FULL.speeds)}
    for speed in FULL.speeds:
        braking = speed**2 / (2.0 * SimulationSpec.acceleration)
        assert travel_for(np.array([speed]))[0] - braking > 0.2 * speed


def test_sets_share_slider_or_table_but_not_their_noise() -> None:
    one, other_surface, other_shape = (
        learning_spec(QUICK, *pair) for pair in (("rect1", "abs"), ("rect1", "pu"), ("ellip1", "abs"))
    )
    repeated = grid_spec(QUICK, "rect1", "abs", 7, 0.5, 0.0, 10)
    assert one.slider_seed == other_surface.slider_seed == repeated.slider_seed
    assert one.surface_seed == other_shape.surface_seed == repeated.surface_seed != other_surface.surface_seed
    assert len({s.seed for s in (one, other_surface, other_shape, repeated)}) == 4
    assert len({pair_number(*pair) for pair in FULL.pairs}) == 16


@pytest.mark.long
def test_seed_reproduces_a_recording_which_can_be_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("push_predictor_paper.data.corpus.WINDOWS_PER_PUSH", 1)
    small = replace(QUICK, pushes=2, speeds=(0.05,))
    kept = learning_set(small, "rect1", "abs", tmp_path)
    again = learning_set(small, "rect1", "abs")
    np.testing.assert_array_equal(kept.table.outcomes, again.table.outcomes)
    read = load_data([tmp_path / "rect1_abs"])
    np.testing.assert_allclose(read.outcomes, kept.table.outcomes, atol=1e-12)
    assert not kept.table.covariates


def test_repetitions_of_one_push_differ_and_follow_its_command() -> None:
    cell = repeat_push(QUICK, "rect1", "plywood", 0, 0.5, 0.0, 12, None)
    assert len(cell.outcomes) == 12 and cell.enough
    assert np.all(cell.sd > 0.0)
    assert np.all(np.abs(cell.inputs.mean(axis=0) - [0.02, 0.125, 0.0]) < [5e-4, 2e-3, 2e-2])
    np.testing.assert_allclose(cell.paths[:, 10, :2], cell.outcomes[:, :2], atol=2e-4)  # 10 steps of 20 ms are a window
    low, high = cell.sd_interval
    assert np.all(low < cell.sd) and np.all(cell.sd < high)


def test_push_with_too_few_repetitions_has_no_mean() -> None:
    cell = made_up_grid().cells[0]
    few = replace(cell, outcomes=cell.outcomes[: FEWEST - 1])
    assert np.isnan(few.mean).all() and np.isnan(few.sd).all() and np.isnan(few.sd_interval).all()


@pytest.mark.parametrize(
    ("of", "left", "reason"),
    [
        (modality, 3, "No push of the grid"),
        (divergence, 3, "No push of the grid"),
        (maps, 2, "Only 0 pushes"),
        (noise, 2, "have enough repetitions"),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_grid_with_too_few_repetitions_decides_nothing(tmp_path: Path, of: Any, left: int, reason: str) -> None:
    study = made_up_study(tmp_path)
    few = tuple(replace(cell, outcomes=cell.outcomes[:left]) for cell in study.reference_grid.cells)
    with pytest.raises(TooFewError, match=reason):
        of.section(replace(study, grids={"plywood": replace(study.reference_grid, cells=few)}))


def test_the_maps_of_a_grid_lie_angle_by_contact() -> None:
    grid = made_up_grid()
    assert grid.mean.shape == (len(grid.angles), len(grid.fractions), 3)
    for cell in grid.cells:
        row, column = list(grid.angles).index(cell.angle), list(grid.fractions).index(cell.fraction)
        np.testing.assert_array_equal(grid.mean[row, column], cell.mean)


def test_section_names_speeds_with_too_few_windows(tmp_path: Path) -> None:
    missing = made_up_corpus()
    slow = {pair: replace(s, table=s.table.take(s.table.inputs[:, 0] < 0.06)) for pair, s in missing.sets.items()}
    evidence = section(replace(made_up_study(tmp_path), simulated=replace(missing, sets=slow))).evidence["sets"]
    assert verdict_on("data", "sets", evidence) == "does not hold"


def test_the_poorest_speed_of_a_set_counts() -> None:
    table = next(iter(made_up_corpus().sets.values())).table
    speed, counts = np.unique(table.inputs[:, 0], return_counts=True)
    assert fewest_windows(replace(PLAN, speeds=tuple(speed)), table) == counts.min()
    assert fewest_windows(replace(PLAN, speeds=(*speed, 0.9)), table) == 0


@pytest.mark.slow
def test_the_learning_data_hold_with_all_sixteen_sets_and_in_part_with_fewer(tmp_path: Path) -> None:
    study, pushes = made_up_study(tmp_path), next(iter(made_up_corpus().sets.values()))
    assert verdict_on("data", "sets", section(study).evidence["sets"]) == "holds in part"
    every = replace(study.simulated, sets=dict.fromkeys(FULL.pairs, pushes))
    assert verdict_on("data", "sets", section(replace(study, simulated=every)).evidence["sets"]) == "holds"


@pytest.mark.parametrize(
    "repetitions, seen, verdict",
    [
        (100, 55, "holds"),
        (100, 38, "holds in part"),
        (100, 28, "not decided"),
        (100, 10, "does not hold"),
        (20, 55, "does not hold"),  # 20 repetitions give a Gaussian's deviation to 31 %
    ],
)
def test_the_grid_holds_when_the_deviations_of_its_pushes_are_known(repetitions: int, seen: int, verdict: str) -> None:
    cells = list(GRID.cells)  # whose intervals are computed once
    if repetitions < len(cells[0].outcomes):
        cells = [replace(c, commanded=repetitions, outcomes=c.outcomes[:repetitions]) for c in cells]
    few = [replace(c, outcomes=c.outcomes[: round(0.8 * repetitions)]) for c in cells[seen:]]
    evidence = known(replace(GRID, cells=(*cells[:seen], *few)))
    assert verdict_on("data", "known", evidence) == verdict


def test_sets_of_several_corpora_do_not_hide_each_other(tmp_path: Path) -> None:
    study = made_up_study(tmp_path)
    pair = study.simulated.reference
    table = study.simulated.sets[pair].table
    others = PushSet(table.take(np.arange(60)), study.simulated.sets[pair].rig)
    measured = Corpus("measured", "measured: mit_square/pushes_a, one side", {pair: others}, pair)
    tables = section(replace(study, measured=(measured,))).tables
    assert [table.rows[0][2] for table in tables[:2]] == [len(table), 60]


def test_a_corpus_has_a_short_name() -> None:
    assert made_up_corpus().name == "simulated"
    title = "measured: mit_square/pushes_a, one side of a square, 900 overlapping windows"
    assert replace(made_up_corpus(), origin="measured", title=title).name == "measured: mit_square/pushes_a"
    assert replace(made_up_corpus(), origin="measured", title="measured: one").name == "measured: one"
