# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rig of one pair of recordings: slider, support points, frictions, noise and sensors."""

from dataclasses import dataclass

import numpy as np

from benchmarks.points_rig.outlines import Outline, ellipse, hexagon, rectangle
from benchmarks.support.plane import Array

GRAVITY = 9.81  # m/s^2
PUSHER_RADIUS = 0.00475  # m
SURFACES = ("plywood", "glass", "pvc", "aluminium", "felt")
TOPICS = ("surface/temperature", "room/humidity", "motor/current")


@dataclass(frozen=True)
class Rig:
    """What training and new recording have in common; lengths in m, masses in kg, loads sum to 1."""

    outline: Outline
    supports: Array  # (N, 2), body frame
    loads: Array  # (N,)
    mass: float
    surface: str
    surface_friction: float
    contact_friction: float
    noise: float  # relative amplitude of the random variation
    speeds: tuple[float, ...]  # m/s
    tracker_rate: float  # Hz
    chain: int  # pushes between two resets of the slider
    lifts: bool  # lifts the tip after a push, or drives back
    topics: tuple[str, ...]
    topic_rate: float  # Hz

    @property
    def resistance(self) -> float:
        """Friction force of the slider in pure translation, N."""
        return self.surface_friction * self.weight

    @property
    def weight(self) -> float:
        """Weight of the slider, N."""
        return self.mass * GRAVITY

    @property
    def load_centre(self) -> Array:
        """Centroid (2,) of the load, m."""
        return self.loads @ self.supports

    @property
    def load_radius(self) -> float:
        """Mean distance of the load from its centroid, m."""
        return float(self.loads @ np.linalg.norm(self.supports - self.load_centre, axis=1))

    def record(self) -> dict[str, str]:
        """The `push_rig` record of the bags."""
        return self.outline.record() | {
            "pusher_radius": repr(PUSHER_RADIUS),
            "surface": self.surface,
            "object_mass": f"{self.mass:.3f}",
        }


def draw_rig(random: np.random.Generator) -> Rig:
    """Draw a rig."""
    outline = _draw_outline(random)
    supports = _draw_supports(random, outline)
    return Rig(
        outline=outline,
        supports=supports,
        loads=_draw_loads(random, supports),
        mass=float(random.uniform(0.8, 1.2)),
        surface=str(random.choice(SURFACES)),
        surface_friction=float(random.uniform(0.2, 0.4)),
        contact_friction=float(random.uniform(0.15, 0.4)),
        noise=float(random.uniform(0.9, 1.6)),
        speeds=((0.01, 0.02, 0.03, 0.05), (0.02, 0.03, 0.05), (0.02, 0.05))[random.integers(3)],
        tracker_rate=float(random.choice([100.0, 125.0, 200.0, 250.0])),
        chain=int(random.choice([1, 1, 1, 2, 3])),
        lifts=bool(random.random() < 0.6),
        topics=tuple(TOPICS[: 1 + random.integers(2)]),
        topic_rate=float(random.choice([1.0, 2.0, 5.0, 10.0])),
    )


def _draw_outline(random: np.random.Generator) -> Outline:
    kind = random.choice(4, p=[0.58, 0.14, 0.14, 0.14])
    outlines = (rectangle("square", 0.09, 0.09), rectangle("rectangle", 0.11, 0.08), ellipse(0.058, 0.045))
    return (*outlines, hexagon(0.052))[kind]


def _draw_supports(random: np.random.Generator, outline: Outline) -> Array:
    """Support points that keep their distance: of several candidates, the one farthest from those chosen."""
    count = int(random.integers(30, 101))
    pool = random.uniform(-outline.reach, outline.reach, (6000, 2))
    pool = pool[outline.contains(pool, 0.003)]
    chosen = [pool[0]]
    distance = np.full(len(pool), np.inf)
    while len(chosen) < count:
        distance = np.minimum(distance, np.linalg.norm(pool - chosen[-1], axis=1))
        candidates = random.integers(len(pool), size=12)
        chosen.append(pool[candidates[distance[candidates].argmax()]])
    return np.array(chosen)


def _draw_loads(random: np.random.Generator, supports: Array) -> Array:
    """Even, towards the rim, towards the centre or lopsided, each with uneven single points."""
    kind = int(random.integers(4))
    scale = np.linalg.norm(supports, axis=1).max()
    radius = np.linalg.norm(supports, axis=1) / scale
    angle = random.uniform(0.0, 2 * np.pi)
    side = supports @ [np.cos(angle), np.sin(angle)] / scale
    exponent = (0.0 * radius, 1.5 * radius, -1.5 * radius, 0.5 * side)[kind]
    loads = np.exp(exponent + random.normal(0.0, 0.25, len(supports)))
    return np.asarray(loads / loads.sum())
