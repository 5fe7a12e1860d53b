# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The training data: pushes of several sliders on several surfaces, simulated or measured, never mixed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.recordings.write import write_recording
from push_predictor.simulation.pushes import PushPlan
from push_predictor.simulation.rig_simulator import SimulationSpec, simulate
from push_predictor.simulation.spec import simulated_rig
from push_predictor.types import Array
from push_predictor_paper.plan import SHAPES, SURFACES, WINDOW, Plan
from push_predictor_paper.work import Work

Pair = tuple[str, str]  # shape, surface
WINDOWS_PER_PUSH = 4.3
LONGEST = 0.05  # m, unless one window is longer


@dataclass(frozen=True, eq=False)
class PushSet:
    """Windows of pushes of one slider on one surface."""

    table: PushTable
    rig: Rig


@dataclass(frozen=True, eq=False)
class Corpus:
    """Push sets by pair of shape and surface, all of one origin. reference: the pair of the single-pair results.

    title: the origin of the pushes, for a reader of a table. notes: what was skipped, and why.
    """

    origin: Literal["simulated", "measured"]
    title: str
    sets: Mapping[Pair, PushSet]
    reference: Pair
    notes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Short name for a sentence: "simulated", "measured: mit_square/pushes_a"."""
        return self.origin if self.origin == "simulated" else self.title.partition(",")[0]

    @property
    def reference_name(self) -> str:
        """The reference pair in a sentence: "rect1 on plywood"."""
        return " on ".join(self.reference)


def simulated_corpus(plan: Plan, work: Work, keep: Path | None = None) -> Corpus:
    """Simulate the training recordings of a plan and find their windows. keep: folder for the recordings."""
    calls = [(plan, shape, surface, keep) for shape, surface in plan.pairs]
    sets = work.run("training recordings", learning_set, calls)
    for call in calls:
        if keep is not None and not (keep / learning_spec(*call[:3]).name).exists():
            learning_set(*call)  # the windows came from the cache, but the recording is gone
    speeds = f"{plan.speeds[0] * 1e3:.0f} to {plan.speeds[-1] * 1e3:.0f} mm/s"
    pushes = f"{plan.pushes} pushes ({plan.reference_pushes} of {' on '.join(plan.pairs[0])})"
    title = f"simulated: {len(calls)} recordings of {pushes} at {len(plan.speeds)} speeds, {speeds}"
    return Corpus("simulated", title, dict(zip(plan.pairs, sets, strict=True)), plan.pairs[0])


def learning_set(plan: Plan, shape: str, surface: str, keep: Path | None = None) -> PushSet:
    """Simulate one training recording and find its windows."""
    spec = learning_spec(plan, shape, surface)
    recording, rig = simulate(spec), simulated_rig(spec)
    if keep is not None:
        write_recording(keep / spec.name, recording)
    return PushSet(bare(windows_to_table(find_windows(recording, rig))), rig)


def learning_spec(plan: Plan, shape: str, surface: str) -> SimulationSpec:
    """The pushes of one training recording: equally many at every speed, contact and angle uniform."""
    place = pair_number(shape, surface)
    rng = np.random.default_rng([plan.seed, place])
    count = plan.pushes_of((shape, surface))
    speed = rng.permutation(np.resize(np.asarray(plan.speeds), count))
    angle = rng.uniform(-1.5, 1.5, count)
    pushes = PushPlan(rng.random(count), angle, speed, travel_for(speed))
    return on_the_table(SimulationSpec(shape, surface, pushes, name=f"{shape}_{surface}"), plan.seed, place)


def on_the_table(spec: SimulationSpec, seed: int, draw: int) -> SimulationSpec:
    """The spec on the table of its surface, the same in every recording; draw: number of the recording."""
    table = SURFACES.index(str(spec.surface))
    return replace(spec, seed=1000 * seed + draw, surface_seed=100 * seed + table, slider_seed=seed)


def pair_number(shape: str, surface: str) -> int:
    """A number for each pair of shape and surface."""
    return SHAPES.index(shape) * len(SURFACES) + SURFACES.index(surface)


def travel_for(speed: Array) -> Array:
    """Travel (n,) m at speeds (n,) m/s: about four windows, at least one and the robot's braking."""
    several = np.minimum(WINDOWS_PER_PUSH * WINDOW * speed, LONGEST)
    braking = speed**2 / (2.0 * SimulationSpec.acceleration)
    return np.minimum(np.maximum(several, 1.15 * WINDOW * speed) + braking + 0.002, 0.2)


def bare(table: PushTable) -> PushTable:
    """The table without covariates, which processes pass to each other."""
    return replace(table, covariates={})
