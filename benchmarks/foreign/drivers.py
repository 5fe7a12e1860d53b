# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What an effect depends on: a recorded or hidden quantity, and the shape of the dependence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.foreign.conditions import State
from benchmarks.support.plane import Array

PATCH_WIDTH = 0.035  # m, standard deviation of a place on the table


@dataclass(frozen=True)
class Driver:
    """Dependence of an effect's size on `name`, with values of its strength mostly in [0, 1].

    `at` is where a step happens (push index), or which edge, heading (rad) or rest (s) counts; `low` and `high` are
    the range of the quantity over the new recording; `place` is a place on the table, m.
    """

    name: str
    form: str
    at: float = 0.0
    low: float = 0.0
    high: float = 1.0
    place: tuple[float, float] = (0.0, 0.0)

    def strength(self, state: State) -> Array:
        """Strength for each push of a batch."""
        if self.name == "place":
            apart = state.pose[:, :2] - np.array(self.place)
            return np.asarray(np.exp(-0.5 * np.sum(apart**2, axis=1) / PATCH_WIDTH**2))
        if self.name == "heading":
            return np.asarray(np.cos(state.pose[:, 2] - self.at))
        facts = state.facts
        if self.name == "constant":
            return np.ones(len(facts.index))
        if self.name == "edge":
            return np.asarray(facts.edge == self.at, dtype=np.float64)
        if self.name == "step":
            return np.asarray(facts.index >= self.at, dtype=np.float64)
        if self.name == "rest":
            return np.asarray(np.log1p(facts.rest) / np.log1p(5.0))
        return self._drift(self._quantity(state))

    def _quantity(self, state: State) -> Array:
        facts = state.facts
        known = {"push_index": facts.index, "elapsed_time": facts.time, "slid_distance": facts.slid}
        return (known | {"temperature": facts.temperature, "speed": facts.speed})[self.name]

    def _drift(self, quantity: Array) -> Array:
        """Rise from 0 to about 1 over the recorded range."""
        share = np.clip((quantity - self.low) / (self.high - self.low), 0.0, 1.5)
        return np.asarray(1 - np.exp(-4 * share) if self.form == "saturating" else share)
