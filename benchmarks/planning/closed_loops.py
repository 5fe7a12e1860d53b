# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Closed loops on the live rig: sliders from the origin to their goals in lockstep, whatever plans."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import numpy as np

from examples.mpc import PLACING
from examples.square import WINDOW
from push_predictor.geometry.frames import paired, rotate
from push_predictor.geometry.touch import touches
from push_predictor.planning.goal import Goal
from push_predictor.recordings.table import PushTable
from push_predictor.simulation.interactive_rig import LiveRig
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array, BoolArray, IntArray

LIMIT = 20.0  # s of rig time


class Command(NamedTuple):
    """A window (3: speed m/s, contact, direction in the world rad), `windows` times over; place: the tip first."""

    window: Array
    place: bool
    windows: int


Planner: TypeAlias = Callable[[Array, "Array | None"], Command]  # of a slider (3,) and its tip (2,), None if lifted


@dataclass(eq=False)
class Runs:
    """n runs: rig time s and success (n,), and all windows."""

    spent: Array
    reached: BoolArray
    seen: list[PushTable] = field(default_factory=list)


def run(planners: Sequence[Planner], goals: Sequence[Goal], spec: SimulationSpec) -> Runs:
    """Push sliders from the origin in lockstep until they rest at their goals or LIMIT s have passed."""
    n, rig = len(goals), LiveRig(spec, np.zeros((len(goals), 3)))
    runs = Runs(np.zeros(n), np.zeros(n, dtype=np.bool_))
    active = np.arange(n)

    def at_goal(rows: IntArray) -> BoolArray:
        return np.array([goals[k].reached(goals[k].ahead(rig.sliders[k])) for k in rows], dtype=np.bool_)

    while True:
        rig.stop(active[at_goal(active)])
        runs.reached[active] = at_goal(active)
        active = active[~runs.reached[active] & (runs.spent[active] < LIMIT)]
        if not len(active):
            return runs
        commands = [planners[k](rig.sliders[k], rig.tips[k] if rig.placed[k] else None) for k in active.tolist()]
        _execute(rig, active, commands, runs)


def _execute(rig: LiveRig, rows: IntArray, commands: Sequence[Command], runs: Runs) -> None:
    """Push the sliders `rows`, each as commanded; a push of several windows ends at rest."""
    window, place, count = (np.array(column) for column in zip(*commands, strict=True))
    rig.place(rows[place], window[place, 1])
    runs.spent[rows] += PLACING * place + WINDOW * count
    for turn in range(count.max()):
        going = rows[count > turn]
        speed, _, heading = window[count > turn].T
        before, tips = rig.sliders[going], rig.tips[going]
        rig.push(going, speed, heading, WINDOW)
        touch = touches(rig.outline, before, tips, speed[:, None] * paired(np.cos(heading), np.sin(heading)))
        moved = rig.sliders[going] - before
        outcome = np.column_stack([rotate(moved[:, :2], -heading), moved[:, 2]])
        ids = np.array([f"{k}-{rig.placed[k]}" for k in going])
        runs.seen.append(PushTable(touch.inputs, np.full(len(going), WINDOW), outcome, ids))
    rig.stop(rows[count > 1])
