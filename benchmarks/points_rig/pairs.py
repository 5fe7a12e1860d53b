# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Make one numbered pair of recordings with its truth, from a seed."""

import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.points_rig.pieces import clean_ratio
from benchmarks.points_rig.rigs import Rig, draw_rig
from benchmarks.points_rig.scenarios import Scenario, describe, draw_scenario
from benchmarks.points_rig.sensors import Streams, sense
from benchmarks.points_rig.sessions import Session, plan_session
from benchmarks.points_rig.simulation import draw_noise, simulate
from benchmarks.support.bags import write_bag
from benchmarks.support.truths import write_truth

EPOCH = 1_760_000_000  # s, absolute time of the first training session


@dataclass(frozen=True)
class Pair:
    """Sensor streams of both recordings, their absolute starts in s, and the truth."""

    rig: Rig
    training: Streams
    new: Streams
    starts: tuple[float, float]
    truth: dict[str, object]


def make_pair(seed: int, number: int, training: int, later: int) -> Pair:
    """Simulate a pair of recordings of `training` and `later` pushes."""
    random = np.random.default_rng([seed, number])
    rig = draw_rig(random)
    scenario = draw_scenario(random, rig, seed, number)
    before = plan_session(random, rig, training, scenario.shift)
    after = plan_session(random, rig, later, scenario.shift, later=True)
    start = EPOCH + 86_400.0 * number
    gap = float(random.integers(1, 15)) * 3600.0
    truth = {"number": number, "group": scenario.group, "seed": seed, "engine": "points_rig"}
    truth |= {"shape": rig.outline.shape, "surface": rig.surface, "friction": rig.surface_friction}
    truth |= {"pushes": later, "training_pushes": training} | describe(scenario, after)
    ratio_seed = int(random.integers(2**31))
    truth["clean_ratio"] = clean_ratio(rig, after, ratio_seed, scenario.effects, scenario.noise_ratio)
    return Pair(
        rig,
        record(random, rig, before, Scenario("none")),
        record(random, rig, after, scenario),
        (start, start + np.ceil(before.stop[-1]) + gap),
        truth,
    )


def write_pair(pair: Pair, data: Path, truth: Path) -> None:
    """Write both bags below `data`/NNN, then the truth file, which marks the pair as finished."""
    number = f"{pair.truth['number']:03d}"
    for name, streams, start in zip(("training", "new"), (pair.training, pair.new), pair.starts, strict=True):
        shutil.rmtree(data / number / name, ignore_errors=True)
        write_bag(data / number / name, streams.serialised(start), pair.rig.record(), "points_rig")
    write_truth(truth / f"{number}.json", pair.truth)


def record(random: np.random.Generator, rig: Rig, session: Session, scenario: Scenario) -> Streams:
    """Simulate a session and what its sensors measure."""
    noise = draw_noise(random, rig, session, scenario.noise_ratio)
    tracks = simulate(rig, session, noise, scenario.effects)
    if tracks.failed.any():
        print(f"{tracks.failed.sum()} steps without a solved balance of forces")
    return sense(random, rig, session, tracks, scenario.fault)
