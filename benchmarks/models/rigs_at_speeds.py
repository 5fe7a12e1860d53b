# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The simulated rigs of this repository pushed at chosen speeds: the project's, the foreign one and that of points.

Three simulators that share no code: `push_predictor.simulation`, `benchmarks.foreign` and `benchmarks.points_rig`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.foreign import engine
from benchmarks.foreign.change import Change
from benchmarks.foreign.plan import PushDistribution
from benchmarks.foreign.recording import FIRST_DAY, draw_inputs, write_session
from benchmarks.foreign.rig import draw_rig as draw_foreign_rig
from benchmarks.points_rig.pairs import EPOCH, record
from benchmarks.points_rig.rigs import draw_rig as draw_points_rig
from benchmarks.points_rig.scenarios import Scenario
from benchmarks.points_rig.sessions import plan_session
from benchmarks.support.bags import write_bag
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.write import write_recording
from push_predictor.simulation.pushes import random_pushes
from push_predictor.simulation.rig_simulator import SimulationSpec, simulate

Write = Callable[[Path, int, int, int, Sequence[float]], None]
PAIRS = (("rect1", "abs"), ("hex", "delrin"), ("ellip2", "plywood"), ("rect1", "plywood"))
TRAVEL = 0.05  # m: fast pushes have a window too


def session(
    rig: str, number: int, which: int, pushes: int, speeds: Sequence[float], work: Path
) -> tuple[PushTable, Rig]:
    """The windows of one recording, and the rig as a model knows it.

    rig: one of RIGS. number: of the rig. which: of its recordings. speeds: m/s, in turn or at random for each push.
    work: a folder for recordings, which are kept and used again.
    """
    name = "-".join(f"{1e3 * speed:g}" for speed in speeds)
    folder = work / f"{rig}_{number}_{which}_{pushes}_{name}"
    if not folder.exists():
        RIGS[rig](folder, number, which, pushes, speeds)
    return load_data([folder]), load_rig_for([folder])


def _simulated(folder: Path, number: int, which: int, pushes: int, speeds: Sequence[float]) -> None:
    shape, surface = PAIRS[number % len(PAIRS)]
    plan = random_pushes(pushes, speeds, TRAVEL, np.random.default_rng([number, which]))
    write_recording(folder, simulate(SimulationSpec(shape, surface, plan, seed=100 * number + which)))


def _foreign(folder: Path, number: int, which: int, pushes: int, speeds: Sequence[float]) -> None:
    rig, rng = draw_foreign_rig(np.random.default_rng([number])), np.random.default_rng([number, 1, which])
    shares = tuple(1.0 / len(speeds) for _ in speeds)
    inputs = draw_inputs(rng, rig, pushes, PushDistribution(tuple(speeds), shares))
    motion = engine.simulate(rig, inputs.plan, inputs.facts, inputs.noise, ())
    write_session(rng, folder, rig, inputs, motion, Change("none"), FIRST_DAY)


def _points(folder: Path, number: int, which: int, pushes: int, speeds: Sequence[float]) -> None:
    rig, rng = draw_points_rig(np.random.default_rng([number])), np.random.default_rng([number, 1, which])
    rig = replace(rig, speeds=tuple(speeds))
    planned = plan_session(rng, rig, pushes)
    streams = record(rng, rig, planned, Scenario("none"))
    write_bag(folder, streams.serialised(float(EPOCH)), rig.record(), "points_rig")


RIGS: dict[str, Write] = {"simulated": _simulated, "foreign": _foreign, "points": _points}
