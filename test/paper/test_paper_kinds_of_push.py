# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Three kinds of push: chosen by rule, judged by repetitions that did not choose them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import paper_studies
import pytest
from push_predictor_paper.data.repetitions import DRAWS, PATH_POINTS, RepeatedGrid, Repetitions
from push_predictor_paper.section import Section, TooFewError
from push_predictor_paper.sections import kinds_of_push
from push_predictor_paper.sections.kinds_of_push import (
    OfPaths,
    apart_evidence,
    final_spread,
    growth,
    growth_evidence,
    kinds_of,
    relative_spread,
    resampled,
    section,
    to_the_end,
    whole_paths,
)
from push_predictor_paper.study import Study

from push_predictor.reporting.canvas import Picture
from push_predictor.types import Array

ALONG = np.linspace(0.0, 1.0, PATH_POINTS)
WAY = 0.006  # m


def rays(sd: float, repetitions: int = 60, seed: int = 0, apart_by: float = 0.0, power: float = 1.0) -> Array:
    """Paths that part across as the way to a power, by a normal sd (m) at the end, about two rays apart_by (m)."""
    rng = np.random.default_rng(seed)
    end = sd * rng.standard_normal(repetitions) + apart_by * rng.integers(0, 2, repetitions)
    along = WAY * ALONG + sd * rng.standard_normal(repetitions)[:, None] * ALONG**power
    return np.stack([along, end[:, None] * ALONG**power, 20.0 * end[:, None] * ALONG**power], axis=-1)


def grid_of(*paths: Array, fraction: float = 0.4) -> RepeatedGrid:
    """A grid whose pushes at one contact went these paths."""
    cells = []
    for k, one in enumerate(paths):
        inputs = np.tile([0.02, 0.1, 0.1 * k], (len(one), 1))
        cells.append(Repetitions(fraction, 0.1 * k, len(one), inputs, one[:, PATH_POINTS // 2], one))
    angles = np.array([cell.angle for cell in cells])
    return RepeatedGrid(
        "rect1", "plywood", paper_studies.rig_of("rect1", "plywood"), np.array([fraction]), angles, tuple(cells)
    )


def study_of(folder: Path, grid: RepeatedGrid) -> Study:
    """A study with this grid as its reference."""
    made_up = paper_studies.made_up_study(folder)
    return Study(made_up.plan, made_up.work, folder, made_up.simulated, (), {"plywood": grid})


def verdicts(made: Section) -> list[str]:
    """On growth, ending apart, modes."""
    return [paper_studies.verdict_on("kinds_of_push", claim, evidence) for claim, evidence in made.evidence.items()]


def drawn_together(sd: float, seed: int = 0) -> Array:
    """Paths that part early and stay as far apart as they are."""
    return rays(sd, seed=seed, power=0.1)


def fanned_out(sd: float, seed: int = 0) -> Array:
    """Paths that part the more, the further they go."""
    return rays(sd, seed=seed, power=2.0)


def test_growth_along_the_path_not_the_spread_chooses_and_the_dip_chooses_the_third() -> None:
    """A wide push that draws together is convergent, a narrow one that fans out divergent."""
    kinds = kinds_of(grid_of(rays(6e-4), drawn_together(1e-3), fanned_out(3e-4), rays(4e-4, apart_by=4e-3)))
    assert kinds is not None
    assert (kinds.convergent, kinds.divergent, kinds.modal) == (1, 2, 3)
    assert kinds.p[3].min() <= 0.05 < kinds.p[:3].min()


def test_pushes_that_hardly_move_the_slider_are_not_chosen() -> None:
    """A grazing push has a huge spread relative to its way; it is passed over."""
    grazing = 0.1 * rays(2e-3)
    assert kinds_of(grid_of(rays(1e-4), grazing)) is None
    kinds = kinds_of(grid_of(rays(1e-4), grazing, rays(3e-4)))
    assert kinds is not None
    assert len(kinds.cells) == 2


def test_pushes_whose_tip_slides_off_are_not_chosen() -> None:
    """One repetition in sixty that stops early is let pass, one in ten is not; a slider that still turns goes on."""
    few, many = rays(1e-4), rays(1e-4)
    few[0, -8:] = few[0, -9]
    many[:6, -8:] = many[:6, -9][:, None]
    assert to_the_end(few) and not to_the_end(many)
    many[..., 2] = 0.1 * ALONG
    assert to_the_end(many)


def test_pushes_that_begin_at_a_corner_are_not_chosen() -> None:
    """The outermost contacts of the grid."""
    paths = (rays(1e-4), rays(3e-4))
    assert kinds_of(grid_of(*paths, fraction=0.9)) is not None
    assert kinds_of(grid_of(*paths, fraction=0.9945)) is None and kinds_of(grid_of(*paths, fraction=0.0055)) is None


def test_drops_a_path_that_runs_into_the_reset() -> None:
    """A slider that jumps further than the tip could push it was put back, not pushed."""
    paths = rays(1e-4)
    paths[7, -1, 0] += 0.02
    assert len(whole_paths(paths)) == len(paths) - 1


def test_relative_spread_and_growth_of_rays_are_what_they_were_made_with() -> None:
    """sd across and along are equal: the spread is sqrt(2) sd; straight rays keep it, bent ones widen or narrow it."""
    paths, half = rays(3e-4, 4000), ALONG[PATH_POINTS // 2]
    assert relative_spread(paths) == pytest.approx(np.sqrt(2.0) * 3e-4 / WAY, rel=0.05)
    assert growth(paths) == pytest.approx(1.0, abs=0.02)
    assert growth(rays(3e-4, 4000, power=2.0)) == pytest.approx(1.0 / half, abs=0.05)
    assert growth(rays(3e-4, 4000, power=0.0)) == pytest.approx(half, abs=0.05)


@pytest.mark.parametrize("figure", [final_spread, relative_spread, growth])
def test_resampled_figures_are_those_of_the_paths_drawn(figure: OfPaths) -> None:
    paths = rays(3e-4, power=0.5)
    rows = np.random.default_rng(0).integers(0, len(paths), (DRAWS, len(paths)))
    np.testing.assert_allclose(resampled(paths, figure)[1], [figure(paths[drawn]) for drawn in rows])


@pytest.mark.long
def test_section_finds_all_three_kinds_in_a_grid_that_has_them(tmp_path: Path) -> None:
    """Findings and a picture."""
    grid = grid_of(rays(6e-4), drawn_together(1e-4), fanned_out(1e-3), rays(4e-4, apart_by=4e-3))
    made = section(study_of(tmp_path, grid))
    assert verdicts(made) == ["holds"] * 3
    assert made.pictures[0].path.stat().st_size > 10_000


def test_equal_pushes_are_not_distinguished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten pushes of one spread, straight: the half that did not choose the extremes shows that they are chance."""
    monkeypatch.setattr(kinds_of_push, "_picture", lambda *_: Picture(tmp_path, "", ""))
    made = section(study_of(tmp_path, grid_of(*(rays(3e-4, 60, seed) for seed in range(10)))))
    assert not {*verdicts(made)} & {"holds", "holds in part"}


def test_a_wide_push_that_draws_together_does_not_end_closer() -> None:
    """Convergent and divergent by their growth, but the convergent one ends further apart: the second does not hold."""
    kinds = kinds_of(grid_of(drawn_together(1e-3), fanned_out(3e-4)))
    assert kinds is not None
    assert paper_studies.verdict_on("kinds_of_push", "growth", growth_evidence(kinds)) == "holds"
    assert paper_studies.verdict_on("kinds_of_push", "apart", apart_evidence(kinds)) == "does not hold"
    narrow = kinds_of(grid_of(drawn_together(1e-4), fanned_out(1e-3)))
    assert narrow is not None
    assert paper_studies.verdict_on("kinds_of_push", "apart", apart_evidence(narrow)) == "holds"


def test_grid_that_moves_nothing_is_not_decided(tmp_path: Path) -> None:
    """Nothing to choose from: not decided, with a note."""
    with pytest.raises(TooFewError, match="Fewer than two pushes"):
        section(study_of(tmp_path, grid_of(0.01 * rays(1e-4))))
