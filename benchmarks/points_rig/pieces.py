# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Displacements over pieces of 0.2 s, and how large an effect is compared with the noise."""

import numpy as np

from benchmarks.points_rig.effects import Effect
from benchmarks.points_rig.rigs import Rig
from benchmarks.points_rig.sessions import Session
from benchmarks.points_rig.simulation import Tracks, draw_noise, simulate
from benchmarks.support.plane import Array, IntArray, rotate
from benchmarks.support.truths import change_over_noise

PIECE = 0.2  # s
JUDGED_PUSHES = 120


def displacements(session: Session, tracks: Tracks) -> Array:
    """(dx, dy, dtheta) of all whole pieces (W, 3) from the first touch on, in the frame of the push: m, m, rad."""
    counts = np.floor(session.travel / session.speed / PIECE).astype(np.int64)
    pushes = np.repeat(np.arange(len(session)), counts)
    number = np.arange(len(pushes)) - np.repeat(np.cumsum(counts) - counts, counts)
    length = PIECE * session.speed[pushes]
    begin = session.gap[pushes] + number * length
    moved = tracks.at(pushes, begin + length) - tracks.at(pushes, begin)
    return np.column_stack([rotate(moved[:, :2], -tracks.heading[pushes]), moved[:, 2]])


def clean_ratio(rig: Rig, session: Session, seed: int, effects: tuple[Effect, ...], ratio: float) -> float:
    """Size of the change in displacement over the difference between two noise draws without the change.

    Of the pieces of some of the session's pushes, each begun where it is planned.
    """
    if not effects and ratio == 1.0:
        return 0.0
    chosen = np.linspace(0, len(session) - 1, min(JUDGED_PUSHES, len(session))).astype(np.int64)
    plain = _pieces(rig, session, seed, chosen)
    other = _pieces(rig, session, seed + 1, chosen)
    changed = _pieces(rig, session, seed, chosen, effects, ratio)
    return change_over_noise(changed, plain, other)


def _pieces(
    rig: Rig, session: Session, seed: int, chosen: IntArray, effects: tuple[Effect, ...] = (), ratio: float = 1.0
) -> Array:
    """Pieces of the chosen pushes with noise drawn from a seed."""
    part = session.unchained(chosen)
    noise = draw_noise(np.random.default_rng(seed), rig, part, ratio)
    return displacements(part, simulate(rig, part, noise, effects))
