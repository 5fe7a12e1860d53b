# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The size of the report: the paper's full size, or a quick one that takes a minute."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array

SHAPES = ("rect1", "ellip1", "ellip2", "ellip3")  # square, circle, two ellipses
SURFACES = ("plywood", "delrin", "pu", "abs")
REFERENCE = ("rect1", "plywood")  # the pair that the paper's maps show
SPEEDS = (0.01, 0.02, 0.05, 0.075, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5)  # m/s
WINDOW = 0.2  # s
GRID_SPEED, GRID_TRAVEL = 0.02, 0.01  # m/s, m


@dataclass(frozen=True)
class Plan:
    """Sizes of everything that the report computes.

    pushes: of each training recording; reference_pushes: of that of the reference pair. sizes: training windows of
    the learning curves; largest: tried on the reference pair only. seeds: draws of training rows, and folds of the
    split by push. contacts, angle_step (rad), repetitions: the grid of repeated pushes on the reference surface;
    other_repetitions: on the other surfaces. speed_pushes: pushes at each speed of the quasi-static claim.
    """

    name: str
    shapes: tuple[str, ...]
    surfaces: tuple[str, ...]
    speeds: tuple[float, ...]
    pushes: int
    reference_pushes: int
    sizes: tuple[int, ...]
    largest: int | None
    seeds: int
    contacts: int
    angle_step: float
    repetitions: int
    other_repetitions: int
    speed_pushes: int
    seed: int = 1

    def pushes_of(self, pair: tuple[str, str]) -> int:
        """Pushes in the training recording of a pair."""
        return self.reference_pushes if pair == REFERENCE else self.pushes

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """All pairs of shape and surface, the reference pair first."""
        every = [(shape, surface) for shape in self.shapes for surface in self.surfaces]
        return sorted(every, key=lambda pair: pair != REFERENCE)

    @property
    def size(self) -> int:
        """Training windows of the models that are shown: the last point of the learning curves."""
        return self.sizes[-1]

    @property
    def grid_fractions(self) -> Array:
        """Contact points of the grid as fractions of a side; the outermost lie half a millimetre inside the corners."""
        return np.clip(np.linspace(0.0, 1.0, self.contacts), 0.0055, 0.9945)

    @property
    def grid_angles(self) -> Array:
        """Angles of the grid, rad: -1.5 to 1.5."""
        return np.linspace(-1.5, 1.5, round(3.0 / self.angle_step) + 1)


FULL = Plan(
    name="full",
    shapes=SHAPES,
    surfaces=SURFACES,
    speeds=SPEEDS,
    pushes=900,
    reference_pushes=1500,
    sizes=(10, 20, 50, 100, 200, 500, 1000),
    largest=2000,
    seeds=5,
    contacts=11,
    angle_step=0.1,
    repetitions=100,
    other_repetitions=50,
    speed_pushes=100,
)
QUICK = Plan(
    name="quick",
    shapes=("rect1", "ellip1"),
    surfaces=("plywood", "abs"),
    speeds=(0.01, 0.02, 0.05, 0.1, 0.2),
    pushes=200,
    reference_pushes=400,
    sizes=(20, 50, 100, 200, 400),
    largest=None,
    seeds=4,
    contacts=5,
    angle_step=0.5,
    repetitions=50,
    other_repetitions=20,
    speed_pushes=50,
)
