# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the strength of an effect depends on: time, number, place, heading, edge, speed or a topic."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from benchmarks.points_rig.rigs import Rig
from benchmarks.points_rig.sessions import Session
from benchmarks.support.plane import Array, IntArray

DriverKind = Literal["constant", "step", "linear", "saturating", "topic", "patch", "heading", "edge", "speed"]
MEASURES = {"time": "elapsed_time", "pushes": "push_index", "distance": "slid_distance"}
LASTING: tuple[DriverKind, ...] = ("constant", "step", "linear", "saturating")
PATCH_RADIUS = 0.035  # m


@dataclass(frozen=True)
class View:
    """What the drivers and effects see of some pushes in one step; one row a push."""

    session: Session
    pushes: IntArray  # (P,), their numbers
    pose: Array  # (P, 3), of the slider: m, m, rad
    edge: IntArray  # (P,), touched edge
    path: Array  # (P,), distance since the touch, m


@dataclass(frozen=True)
class Driver:
    """Strength of an effect, 0 to 1 (of a topic, -1.3 to 1.3)."""

    kind: DriverKind
    measure: str = "pushes"  # of a drift
    place: float = 0.5  # of a step: share of the session
    topic: str = ""
    centre: tuple[float, float] = (0.0, 0.0)  # of a patch, m
    phase: float = 0.0  # of a heading, rad
    edge: int = 0

    def strength(self, view: View) -> Array:
        """Strengths (P,) of the effect."""
        session, pushes = view.session, view.pushes
        match self.kind:
            case "constant":
                return np.ones(len(pushes))
            case "step":
                return np.asarray(session.progress("pushes")[pushes] >= self.place, dtype=float)
            case "linear":
                return np.asarray(session.progress(self.measure)[pushes])
            case "saturating":
                return np.asarray((1 - np.exp(-4 * session.progress(self.measure)[pushes])) / (1 - np.exp(-4)))
            case "topic":
                return session.topic_levels(self.topic)[pushes]
            case "patch":
                distance = np.linalg.norm(view.pose[:, :2] - self.centre, axis=1)
                return np.asarray(np.exp(-0.5 * (distance / PATCH_RADIUS) ** 2))
            case "heading":
                return np.asarray(0.5 + 0.5 * np.cos(view.pose[:, 2] - self.phase))
            case "edge":
                return np.asarray(view.edge == self.edge, dtype=float)
            case "speed":
                above = session.speed - session.speed.min()
                return np.asarray(above[pushes] / above.max())

    @property
    def form(self) -> str:
        """The shape of the dependence, in the truth's words."""
        named = {"topic": "linear", "speed": "linear", "patch": "map", "heading": "periodic", "edge": "category"}
        return named.get(self.kind, self.kind)

    def at_push(self, session: Session) -> float | None:
        """The number of the push from which a step acts, from 0; None for other forms."""
        return self.place * (len(session) - 1) if self.kind == "step" else None

    def covariates(self, session: Session, constant: tuple[str, ...]) -> list[str]:
        """The right covariates; `constant` are those of an effect from the start of the new recording on."""
        match self.kind:
            case "constant":
                return list(constant)
            case "step":
                return [MEASURES[measure] for measure in ("pushes", "time", "distance")]
            case "linear" | "saturating":
                own = session.progress(self.measure)
                alike = [name for name in MEASURES if np.corrcoef(session.progress(name), own)[0, 1] > 0.99]
                return [MEASURES[name] for name in alike]
            case "topic":
                return [f"topic:/{self.topic}"]
            case "patch":
                return ["slider_x", "slider_y"]
            case "heading":
                return ["slider_heading"]
            case "edge":
                return ["edge"]
            case "speed":
                return ["velocity"]


def draw_driver(random: np.random.Generator, rig: Rig, allowed: tuple[DriverKind, ...]) -> Driver:
    """Draw what an effect depends on; two thirds are constant, a step or a drift."""
    weights = {"constant": 0.22, "step": 0.22, "linear": 0.11, "saturating": 0.11, "topic": 0.09}
    weights |= {"patch": 0.07, "heading": 0.07, "speed": 0.05, "edge": 0.06 if rig.outline.edges > 1 else 0.0}
    share = np.array([weights[kind] for kind in allowed])
    return Driver(
        kind=allowed[random.choice(len(allowed), p=share / share.sum())],
        measure=str(random.choice(list(MEASURES))),
        place=round(float(random.uniform(0.25, 0.7)), 3),
        topic=str(random.choice(rig.topics)),
        centre=(float(random.uniform(-0.05, 0.05)), float(random.uniform(-0.05, 0.05))),
        phase=float(random.uniform(-np.pi, np.pi)),
        edge=int(random.integers(rig.outline.edges)),
    )
