# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a push meets at one instant: load, frictions, outer forces. Effects change these, engines use them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.foreign.noise import ProcessNoise, load_modes
from benchmarks.foreign.rig import Rig
from benchmarks.support.plane import Array, IntArray


@dataclass(frozen=True)
class PushFacts:
    """What is known of each push before it begins; SI units, one entry per push."""

    index: Array
    time: Array
    slid: Array
    temperature: Array
    rest: Array
    speed: Array
    edge: Array

    def rows(self, rows: IntArray) -> PushFacts:
        """The facts of some pushes."""
        return PushFacts(**{name: values[rows] for name, values in vars(self).items()})


@dataclass(frozen=True)
class State:
    """Where the pushes of a batch are at one instant: slider pose (m, m, rad), tip contact, travel since touch (m)."""

    pose: Array
    contact: Array
    travelled: Array
    facts: PushFacts


@dataclass(frozen=True)
class Conditions:
    """Conditions of a batch of pushes at one instant.

    `load` (pushes, patches) are shares of the weight; `table_friction` multiplies the table's friction; `tensor`
    (pushes, 2, 2) turns and stretches it, in body axes; `tip_friction` is the friction of the tip; `stiffness` N/m;
    `normal_tilt` rad turns the surface's normal at the tip; `force` N (world axes) and `torque` N m act on the slider's
    centre.
    """

    load: Array
    table_friction: Array
    tensor: Array | None
    tip_friction: Array
    stiffness: Array
    normal_tilt: Array
    force: Array
    torque: Array


def ordinary_conditions(rig: Rig, noise: ProcessNoise, state: State) -> Conditions:
    """Conditions of the unchanged rig."""
    values = noise.at(state.travelled)
    modes = load_modes(rig)
    load = rig.load * np.maximum(1 + values[:, : len(modes)] @ modes, 0.05)
    count = len(values)
    return Conditions(
        load=load / load.sum(axis=1, keepdims=True),
        table_friction=np.exp(values[:, -1]) * rig.table.unevenness(state.pose[:, :2]),
        tensor=None,
        tip_friction=rig.contact_friction * np.exp(values[:, -2]),
        stiffness=np.full(count, rig.stiffness),
        normal_tilt=np.zeros(count),
        force=np.zeros((count, 2)),
        torque=np.zeros(count),
    )
