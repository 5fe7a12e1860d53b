# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Three kinds of repeated push: convergent, divergent, multi-modal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from push_predictor.evaluation.estimate import of_draws
from push_predictor.reporting.canvas import Picture
from push_predictor.types import Array
from push_predictor_paper.claims import LEVEL
from push_predictor_paper.data.repetitions import DRAWS, FEWEST, STEP, RepeatedGrid, Repetitions
from push_predictor_paper.painters.trajectories import Trajectories, paint_trajectories
from push_predictor_paper.plan import GRID_SPEED
from push_predictor_paper.section import Section, TooFewError, picture, speed_text
from push_predictor_paper.statistics.grid_maps import place_text
from push_predictor_paper.statistics.modes import FAR, count_with_modes, dip_tests, found_at
from push_predictor_paper.study import Study
from push_predictor_paper.verdict import Bound, Evidence, Figure

EDGE = 0.05  # of the side from its ends: there the tip starts on the corner, which is another kind of contact
LAST = round(0.1 / (STEP * 1e-9))  # points of a path: its last 0.1 s
STILL = 0.1 * LAST * GRID_SPEED * STEP * 1e-9  # m: a tenth of the tip's way in that time
STILL_TURN = float(np.radians(0.3))  # the tracker's noise, several times over
STOPPED = 0.05  # of the repetitions: pushes of which more stop early are of tips that slid off
LEAST_TRAVEL = 0.002  # m: below it the tip grazes, and a spread relative to the distance means little
LARGEST_STEP = 3.0 * GRID_SPEED * STEP * 1e-9  # m between points of a path: the tip cannot have pushed so far
OfPaths = Callable[[Array], Array]  # of paths (..., r, t, 3), (...): by their beginning, middle and end
NOTES = (
    "Spread: root mean square distance of the slider's centre from its mean; relative: over the mean displacement. "
    "Paths are relative to the slider's pose at the first contact: they show how paths part, not whether differences "
    "at the start vanish. Growth: relative spread at the end over that half-way.",
    f"Only pushes that move the slider by {1e3 * LEAST_TRAVEL:.0f} mm or more, that begin at least {EDGE:g} of the "
    f"side from its ends, and of which at most {STOPPED:.0%} of the repetitions stop early (less than "
    f"{1e3 * STILL:.1f} mm and {np.degrees(STILL_TURN):.1f}° in the last 0.1 s: the tip slid off). Repetitions in "
    "which the slider moves further within 20 ms than the tip could push it run into the reset, and are dropped.",
    "Every second repetition chooses the pushes of least and largest growth, the others test them; otherwise the "
    "extremes of many noisy values would look too extreme. The third has the least p of the dip test on the final x, y "
    "and rotation, family-wise by Holm's correction.",
    "Why simulated repetitions part is a property of the simulator, whose friction and pressure vary over table and "
    "slider. It proves nothing about a real rig. The paper shows its three pushes without numbers.",
)


@dataclass(frozen=True, eq=False)
class Kinds:
    """A grid's pushes that move the slider to their end, with their whole paths.

    convergent, divergent, modal: indices of the chosen pushes. p (p, 3): family-wise p values of the dip of final x, y
    and heading.
    """

    cells: tuple[Repetitions, ...]
    paths: tuple[Array, ...]
    convergent: int
    divergent: int
    modal: int
    p: Array

    def test_half(self, push: int) -> Array:
        """The repetitions of a push that did not choose it."""
        return self.paths[push][1::2]


def section(study: Study) -> Section:
    """Choose a push of each kind, draw its trajectories, and test whether the kinds exist."""
    kinds = kinds_of(study.reference_grid)
    if kinds is None:
        raise TooFewError(f"Fewer than two pushes moved the slider by {1e3 * LEAST_TRAVEL:.0f} mm and up to their end.")
    evidence = {"growth": growth_evidence(kinds), "apart": apart_evidence(kinds), "modes": modes_evidence(kinds)}
    return Section(evidence, pictures=(_picture(study, kinds),), notes=NOTES)


def growth_evidence(kinds: Kinds) -> Evidence:
    """Growth of the two pushes, by repetitions that did not choose them."""
    narrow, wide = (of_draws(*resampled(kinds.test_half(k), growth)) for k in (kinds.convergent, kinds.divergent))
    middle = np.quantile([growth(paths) for paths in kinds.paths], [0.1, 0.5, 0.9])
    note = (
        f"1: straight rays. Of all {len(kinds.paths)} pushes a tenth lies below {middle[0]:.2f}, half below "
        f"{middle[1]:.2f}, a tenth above {middle[2]:.2f}."
    )
    return Evidence([Figure("most convergent", narrow), Figure("most divergent", wide, Bound(low=1.0))], note)


def apart_evidence(kinds: Kinds) -> Evidence:
    """How much further apart the repetitions of the divergent push end."""
    figures = []
    for name, figure in {"spread": final_spread, "relative to the displacement": relative_spread}.items():
        narrow, narrow_draws = resampled(kinds.test_half(kinds.convergent), figure, 0)
        wide, wide_draws = resampled(kinds.test_half(kinds.divergent), figure, 1)
        figures.append(Figure(name, of_draws(wide / narrow, wide_draws / narrow_draws)))
    return Evidence(figures)


def modes_evidence(kinds: Kinds) -> Evidence:
    """The number of pushes with more than one mode."""
    repetitions = int(np.median([len(p) for p in kinds.paths]))
    power = found_at(FAR, repetitions, kinds.p.size, LEVEL)
    several = int((kinds.p <= LEVEL).any(axis=1).sum())
    note = (
        f"Least family-wise p: {kinds.p.min():.2g}. Two equal modes {FAR:.0f} of their sd "
        f"apart would be found in {power:.0%} of cases at {repetitions} repetitions."
    )
    return Evidence([Figure("", count_with_modes(several, power), text=f"{several} of {len(kinds.p)}")], note)


def _picture(study: Study, kinds: Kinds) -> Picture:
    grid = study.reference_grid
    three = {"most convergent": kinds.convergent, "most divergent": kinds.divergent, "largest dip": kinds.modal}
    shown = [
        Trajectories(
            f"{name}: {place_text((kinds.cells[k].fraction, kinds.cells[k].angle))}",
            kinds.cells[k].inputs.mean(axis=0),
            kinds.paths[k],
        )
        for name, k in three.items()
    ]
    return picture(
        study.out / "kinds_of_push.png",
        (10.0, 9.0),
        lambda figure: paint_trajectories(figure, grid.rig, shown),
        "Trajectories of the most convergent push, the most divergent one, and the one with the largest dip. All "
        f"repetitions of three pushes of 1 cm at {speed_text(GRID_SPEED)}, simulated, {grid.shape} on "
        f"{grid.surface}. c: contact as a fraction of the side; angle from its normal. Above: slider at the start, tip "
        "and its path (grey), trajectories of the slider's centre (green). Middle: the same trajectories. Below: final "
        "poses (dots) about their mean, with the 95 % ellipse of a Gaussian (red).",
    )


def kinds_of(grid: RepeatedGrid) -> Kinds | None:
    """Choose the three pushes; None if there are not two that move the slider."""
    whole = [(cell, whole_paths(cell.paths)) for cell in grid.seen]
    kept = [(cell, paths) for cell, paths in whole if EDGE < cell.fraction < 1.0 - EDGE and to_the_end(paths)]
    if len(kept) < 2:
        return None
    cells, paths = zip(*kept, strict=True)
    order = np.argsort([growth(one[::2]) for one in paths])
    alone, p = dip_tests([one[:, -1] for one in paths])
    modal = int(np.argmin(alone.min(axis=1)))
    return Kinds(cells, paths, int(order[0]), int(order[-1]), modal, p)


def to_the_end(paths: Array) -> bool:
    """Whether the push of paths (r, t, 3) moves the slider, in nearly all of them up to its end."""
    if len(paths) < FEWEST or travel(paths[:, -1]) < LEAST_TRAVEL:
        return False
    last = paths[:, -1] - paths[:, -1 - LAST]
    still = (np.hypot(last[:, 0], last[:, 1]) < STILL) & (np.abs(last[:, 2]) < STILL_TURN)
    return bool(still.mean() <= STOPPED)


def whole_paths(paths: Array) -> Array:
    """The paths (r, t, 3) along which the slider never moves further than the tip could push it."""
    steps = np.hypot(*np.moveaxis(np.diff(paths[..., :2], axis=1), -1, 0))
    return np.asarray(paths[steps.max(axis=1) <= LARGEST_STEP])


def relative_spread(paths: Array, place: int = -1) -> Array:
    """Spread of paths (..., r, t, 3) at a place along them over the mean displacement there, (...)."""
    ends = paths[..., place, :2]
    return spread(ends) / travel(ends)


def final_spread(paths: Array) -> Array:
    """Spread (m) of the ends of paths (..., r, t, 3), (...)."""
    return spread(paths[..., -1, :2])


def growth(paths: Array) -> Array:
    """Relative spread at the end over that half-way, (...); above 1 the paths (..., r, t, 3) fan out."""
    return relative_spread(paths) / relative_spread(paths, _middle(paths))


def spread(ends: Array) -> Array:
    """Root mean square distance of points ends (..., r, 2) from their mean, (...)."""
    return np.asarray(np.sqrt(np.sum(np.var(ends, axis=-2, ddof=1), axis=-1)))


def travel(ends: Array) -> Array:
    """Length of the mean displacement of ends (..., r, 2 or 3), (...)."""
    return np.asarray(np.linalg.norm(ends[..., :2].mean(axis=-2), axis=-1))


def resampled(paths: Array, figure: OfPaths, seed: int = 0) -> tuple[float, Array]:
    """A figure of paths (r, t, 3), and its resamples (DRAWS,) over repetitions."""
    rows = np.random.default_rng(seed).integers(0, len(paths), (DRAWS, len(paths)))
    return float(figure(paths)), figure(paths[:, [0, _middle(paths), -1]][rows])


def _middle(paths: Array) -> int:
    return int(paths.shape[-2]) // 2
