# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The validation data: a grid of pushes of one side, each repeated many times, and their outcomes.

The paper: 1 cm at 20 mm/s, 11 contacts on a side, angles from -1.5 to 1.5 rad by 0.1, 100 repetitions of each.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.geometry.outline import Outline
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.recordings.write import write_recording
from push_predictor.simulation.pushes import grid_pushes
from push_predictor.simulation.rig_simulator import SimulationSpec, simulate
from push_predictor.simulation.slider import slider_named
from push_predictor.simulation.spec import simulated_rig
from push_predictor.types import Array
from push_predictor_paper.data.corpus import on_the_table, pair_number
from push_predictor_paper.plan import GRID_SPEED, GRID_TRAVEL, Plan
from push_predictor_paper.work import Work

FEWEST = 10  # repetitions of a push with a mean and a standard deviation
DRAWS = 400  # bootstrap
STEP = 20_000_000  # ns between the points of a path
PATH_POINTS = round(GRID_TRAVEL / GRID_SPEED * 1e9 / STEP) + 1


@dataclass(frozen=True, eq=False)
class Repetitions:
    """The outcomes of one push of the grid in its first window (0.2 s from the first contact).

    fraction: contact along the side, angle in rad, as commanded, and how often. inputs, outcomes (r, 3): the windows;
    r is below `commanded` where the tip slid off too early. paths (r, t, 3): the slider's pose (m, m, rad) every
    20 ms from the first touch to the end of the push, relative to where it was, along the push.
    """

    fraction: float
    angle: float
    commanded: int
    inputs: Array
    outcomes: Array
    paths: Array

    @property
    def enough(self) -> bool:
        """Whether there are enough repetitions for mean and standard deviation."""
        return len(self.outcomes) >= FEWEST

    @property
    def mean(self) -> Array:
        """Mean outcome (3,), NaN with too few repetitions."""
        return self.outcomes.mean(axis=0) if self.enough else np.full(3, np.nan)

    @property
    def sd(self) -> Array:
        """Standard deviation (3,) of the outcome, NaN with too few repetitions."""
        return self.outcomes.std(axis=0, ddof=1) if self.enough else np.full(3, np.nan)

    @cached_property
    def sd_interval(self) -> Array:
        """95 % interval (2, 3) of the sd, from resampling repetitions; each is a separate push."""
        if not self.enough:
            return np.full((2, 3), np.nan)
        rows = np.random.default_rng(0).integers(0, len(self.outcomes), (DRAWS, len(self.outcomes)))
        return np.asarray(np.quantile(self.outcomes[rows].std(axis=1, ddof=1), [0.025, 0.975], axis=0))


@dataclass(frozen=True, eq=False)
class RepeatedGrid:
    """All pushes of the grid on one surface: cells of (contact, angle) in the order of fractions x angles."""

    shape: str
    surface: str
    rig: Rig
    fractions: Array
    angles: Array
    cells: tuple[Repetitions, ...]

    @property
    def mean(self) -> Array:
        """Mean outcomes (A, C, 3) over angle and contact, NaN with too few repetitions."""
        return self.as_map(np.reshape([cell.mean for cell in self.seen], (-1, 3)))

    @property
    def sd(self) -> Array:
        """Standard deviations (A, C, 3) of the outcomes."""
        return self.as_map(np.reshape([cell.sd for cell in self.seen], (-1, 3)))

    @property
    def seen(self) -> list[Repetitions]:
        """The pushes with enough repetitions."""
        return [cell for cell in self.cells if cell.enough]

    @property
    def typical_inputs(self) -> Array:
        """Mean measured inputs (len(seen), 3) of these pushes, at which models are evaluated."""
        return np.array([cell.inputs.mean(axis=0) for cell in self.seen])

    def as_map(self, values: Array) -> Array:
        """Values (..., len(seen), 3) of the pushes seen as maps (..., A, C, 3), NaN elsewhere."""
        enough = np.reshape([cell.enough for cell in self.cells], (len(self.fractions), len(self.angles)))
        maps = np.full((*values.shape[:-2], *enough.shape, 3), np.nan)
        maps[..., enough, :] = values
        return np.asarray(np.swapaxes(maps, -3, -2))


def repeated_grid(
    plan: Plan, work: Work, surface: str, repetitions: int | None = None, keep: Path | None = None
) -> RepeatedGrid:
    """Simulate the grid of repeated pushes of the square, one recording per push of the grid.

    repetitions: other than the plan's. keep: a folder that receives the recordings.
    """
    shape, again = plan.shapes[0], repetitions or plan.repetitions
    places = [(f, a) for f in plan.grid_fractions.tolist() for a in plan.grid_angles.tolist()]
    calls = [(plan, shape, surface, k, f, a, again, keep) for k, (f, a) in enumerate(places)]
    cells = work.run(f"repeated pushes on {surface}", repeat_push, calls)
    for call in calls:
        if keep is not None and not (keep / grid_spec(*call[:-1]).name).exists():
            repeat_push(*call)  # the windows came from the cache, but the recording is gone
    rig = simulated_rig(grid_spec(plan, shape, surface, 0, 0.5, 0.0, 1))
    return RepeatedGrid(shape, surface, rig, plan.grid_fractions, plan.grid_angles, tuple(cells))


def repeat_push(
    plan: Plan, shape: str, surface: str, number: int, fraction: float, angle: float, again: int, keep: Path | None
) -> Repetitions:
    """Simulate one push of the grid `again` times and find the windows."""
    spec = grid_spec(plan, shape, surface, number, fraction, angle, again)
    recording = simulate(spec)
    if keep is not None:
        write_recording(keep / spec.name, recording)
    first = [window for window in find_windows(recording, simulated_rig(spec)) if window.index == 0]
    paths = np.array([_path(recording.slider, window) for window in first])
    return Repetitions(
        fraction,
        angle,
        again,
        np.array([[w.velocity, w.contact, w.angle] for w in first]).reshape(-1, 3),
        np.array([w.displacement for w in first]).reshape(-1, 3),
        paths if first else np.zeros((0, PATH_POINTS, 3)),
    )


def grid_spec(
    plan: Plan, shape: str, surface: str, number: int, fraction: float, angle: float, again: int
) -> SimulationSpec:
    """The recording of one push of the grid on the first side of a slider."""
    contact = float(contact_on_first_side(slider_named(shape).outline, np.array(fraction)))
    pushes = grid_pushes([contact], [angle], again, GRID_SPEED, GRID_TRAVEL)
    name = f"grid_{shape}_{surface}_c{1e3 * fraction:04.0f}_a{1e3 * angle:+05.0f}"
    draw = 100_000 + 1000 * pair_number(shape, surface) + number
    return on_the_table(SimulationSpec(shape, surface, pushes, name=name), plan.seed, draw)


def contact_on_first_side(outline: Outline, fraction: Array) -> Array:
    """Contacts (n,) of fractions (n,) of a polygon's first edge, or of the first quarter of a smooth outline."""
    return fraction * (0.25 if outline.semi_axes is not None else float(outline.edge_starts[1]))


def _path(slider: PoseStream, window: PushWindow) -> Array:
    """Poses (t, 3) relative to the window's start in its push frame, over the time the whole push takes."""
    times = window.start + STEP * np.arange(PATH_POINTS)
    columns = (slider.x, slider.y, np.unwrap(slider.heading))
    poses = np.stack([np.interp(times, slider.stamp, column) for column in columns], axis=-1)
    moved = rotate(poses[:, :2] - poses[0, :2], np.array(-window.push_heading))
    return np.column_stack([moved, poses[:, 2] - poses[0, 2]])
