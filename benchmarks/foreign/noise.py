# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Process noise: random changes of load and friction, between pushes and along the travel of each push."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.foreign.rig import NoiseLevels, Rig
from benchmarks.support.plane import Array, IntArray

NODE_SPACING = 0.001  # m of travel between two drawn values
NODES = 70
TEXTURE_WAVES = np.random.default_rng(8).normal(0, 2 * np.pi / 0.06, (4, 2))  # rad/m, finer than the warp
CHANNELS = 2 + len(TEXTURE_WAVES) + 2


@dataclass(frozen=True)
class ProcessNoise:
    """Relative changes, shape (pushes, nodes, channels): load tilt x and y, load texture, friction of tip and table."""

    values: Array

    def rows(self, rows: IntArray) -> ProcessNoise:
        """The noise of some pushes."""
        return ProcessNoise(self.values[rows])

    def scaled(self, ratio: float) -> ProcessNoise:
        """The same noise, larger by `ratio`."""
        return ProcessNoise(ratio * self.values)

    def at(self, travelled: Array) -> Array:
        """Values after `travelled` m of each push, shape (pushes, channels)."""
        position = np.clip(travelled / NODE_SPACING, 0, NODES - 1.001)
        node = position.astype(int)
        share = (position - node)[:, None]
        row = np.arange(len(node))
        return np.asarray((1 - share) * self.values[row, node] + share * self.values[row, node + 1])


def draw_process_noise(rng: np.random.Generator, levels: NoiseLevels, count: int) -> ProcessNoise:
    """Draw the noise of `count` pushes."""
    size = np.array(
        [levels.tilt] * 2 + [levels.texture] * len(TEXTURE_WAVES) + [levels.tip_friction, levels.table_friction]
    )
    keep = np.exp(-NODE_SPACING / levels.length)
    fresh = rng.standard_normal((count, NODES, CHANNELS))
    walk = np.empty_like(fresh)
    walk[:, 0] = fresh[:, 0]
    for node in range(1, NODES):
        walk[:, node] = keep * walk[:, node - 1] + np.sqrt(1 - keep**2) * fresh[:, node]
    lasting = rng.standard_normal((count, 1, CHANNELS))
    return ProcessNoise(size * (np.sqrt(1 - levels.lasting) * walk + np.sqrt(levels.lasting) * lasting))


def load_modes(rig: Rig) -> Array:
    """How the load's noise channels act on the patches, shape (channels of the load, patches)."""
    radius = np.sqrt(np.mean(np.sum(rig.patches**2, axis=1)))
    texture = np.sqrt(2) * np.sin(rig.patches @ TEXTURE_WAVES.T + np.arange(len(TEXTURE_WAVES)))
    return np.asarray(np.concatenate([rig.patches / radius, texture], axis=1).T)
