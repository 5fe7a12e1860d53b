# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One continuous motion of the rig from single pushes.

Between pushes the lifted tip moves to the next start and the slider is put back; then the tip lowers, pushes and lifts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array

RESET_TIME = 0.20  # s with the tip lifted; the slider moves in the middle third
LOWER_TIME = 0.06  # s to lower, and to lift
LIFTED, DOWN = 0.05, 0.01  # m, height of the tip
PHASE_GAP = 1e-6  # s between the last knot of a phase and the first of the next


@dataclass(frozen=True, eq=False)
class PushMotion:
    """The motion of one push: time (t,) s from its start; slider (t, 3), pusher (t, 2), wrench (t, 3)."""

    time: Array
    slider: Array
    pusher: Array
    wrench: Array


@dataclass(frozen=True, eq=False)
class Truth:
    """The true state of the rig at times (t,) s, linear in between.

    slider (t, 3) with unwrapped heading, pusher (t, 3) with height, wrench (t, 3).
    """

    time: Array
    slider: Array
    pusher: Array
    wrench: Array

    def at(self, time: Array, stream: str) -> Array:
        """Values (n, 3) of one of the three streams at times (n,)."""
        values = getattr(self, stream)
        return np.stack([np.interp(time, self.time, column) for column in values.T], axis=1)


def run_in_turn(pushes: Sequence[PushMotion], pauses: Array | None = None) -> Truth:
    """Concatenate pushes and the phases between them; pauses (n,): additional time of the resets, s."""
    parts: list[tuple[Array, Array, Array, Array]] = []
    clock, before = 0.0, pushes[0]
    for i, push in enumerate(pushes):
        for phase in (
            _reset(before, push, RESET_TIME if pauses is None else RESET_TIME + float(pauses[i])),
            _vertical(push, 0, LIFTED, DOWN),
            _contact_phase(push),
            _vertical(push, -1, DOWN, LIFTED),
        ):
            parts.append((phase[0] + clock + PHASE_GAP, *phase[1:]))
            clock += float(phase[0][-1]) + PHASE_GAP
        before = push
    return Truth(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _reset(before: PushMotion, push: PushMotion, duration: float) -> tuple[Array, Array, Array, Array]:
    share = np.linspace(0.0, 1.0, 31)
    tip = before.pusher[-1] + _eased(share)[:, None] * (push.pusher[0] - before.pusher[-1])
    turn = np.concatenate([[0.0, 0.0], [_shorter_turn(push.slider[0, 2] - before.slider[-1, 2])]])
    shift = np.concatenate([push.slider[0, :2] - before.slider[-1, :2], [0.0]]) + turn
    slider = push.slider[0] - shift + _eased(np.clip(3.0 * share - 1.0, 0.0, 1.0))[:, None] * shift
    return share * duration, slider, _with_height(tip, np.full(len(share), LIFTED)), np.zeros((len(share), 3))


def _vertical(push: PushMotion, end: int, low: float, high: float) -> tuple[Array, Array, Array, Array]:
    share = np.linspace(0.0, 1.0, 11)
    height = low + _eased(share) * (high - low)
    still = np.ones((len(share), 1))
    return (
        share * LOWER_TIME,
        still * push.slider[end],
        _with_height(still * push.pusher[end], height),
        np.zeros((len(share), 3)),
    )


def _contact_phase(push: PushMotion) -> tuple[Array, Array, Array, Array]:
    return push.time, push.slider, _with_height(push.pusher, np.full(len(push.time), DOWN)), push.wrench


def _with_height(tip: Array, height: Array) -> Array:
    return np.column_stack([tip, height])


def _eased(share: Array) -> Array:
    return np.asarray(share**2 * (3.0 - 2.0 * share))


def _shorter_turn(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)
