# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The covariates that every window may have: what each is, its unit, its name in prose, its range in the training."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from push_predictor.types import Array, BoolArray

Kind = Literal["input", "progress", "place", "heading", "category", "pause", "contact", "force", "sensor zero"]
DEGREE = float(np.degrees(1.0))


@dataclass(frozen=True)
class Covariate:
    """A covariate, and how an effect may depend on it.

    kind: "progress" only grows, "heading" wraps around, "force" is an outcome and "sensor zero" what the window finder
    subtracted: neither is a cause. local: shares noise with the residual, or varies along a push. folded: every
    candidate depends on it already. shown: factor to and name of the unit in prose, if it is another.
    """

    phrase: str
    kind: Kind
    unit: str = ""
    local: bool = False
    folded: bool = False
    shown: tuple[float, str] | None = None


COVARIATES: dict[str, Covariate] = {
    "elapsed_time": Covariate("elapsed time", "progress", "s"),
    "push_index": Covariate("push count", "progress"),
    "slid_distance": Covariate("distance slid", "progress", "m"),
    "slider_x": Covariate("the slider's x position", "place", "m"),
    "slider_y": Covariate("the slider's y position", "place", "m"),
    "slider_heading": Covariate("the slider's heading", "heading", "rad", shown=(DEGREE, "deg")),
    "push_heading": Covariate("the push direction in the world", "heading", "rad", shown=(DEGREE, "deg")),
    "velocity": Covariate("pushing speed", "input", "m/s", shown=(1e3, "mm/s")),
    "contact": Covariate("contact point", "input", folded=True),
    "angle": Covariate("push angle", "input", "rad", folded=True, shown=(DEGREE, "deg")),
    "edge": Covariate("side pushed", "category"),
    "recording": Covariate("recording", "category"),
    "dwell_time": Covariate("dwell time before the push", "pause", "s"),
    "contact_gap": Covariate("measured gap at the contact", "contact", "m", local=True, shown=(1e3, "mm")),
    "time_since_contact": Covariate("time since first contact", "contact", "s", local=True),
    "normal_force": Covariate("normal force", "force", "N"),
    "tangential_force": Covariate("tangential force", "force", "N"),
    "free_force_x": Covariate("the force read in free motion along x", "sensor zero", "N"),
    "free_force_y": Covariate("the force read in free motion along y", "sensor zero", "N"),
}
UNITS = {name: each.unit for name, each in COVARIATES.items() if each.unit}  # that of a topic is its publisher's


def of_kind(kind: Kind) -> tuple[str, ...]:
    """The names of the covariates of a kind."""
    return tuple(name for name, covariate in COVARIATES.items() if covariate.kind == kind)


HEADINGS, CUMULATIVE = of_kind("heading"), of_kind("progress")

WHOLE_TURN = np.radians(30.0)  # headings with no wider gap between them cover the whole turn
MARGIN = 1e-6  # relative: a model file keeps seven digits
TURN = 2.0 * np.pi


@dataclass(frozen=True)
class CovariateRange:
    """A range from low to high. For a heading it runs counter-clockwise from low, and high may exceed pi."""

    low: float
    high: float
    heading: bool = False

    def contains(self, values: Array) -> BoolArray:
        """Which of the values (n,) lie in the range."""
        least, most = self._ends
        if self.heading:
            values = least + (values - least) % TURN
        return np.asarray((values >= least) & (values <= most))

    def reaching(self, value: float) -> CovariateRange:
        """The range, raised so that it contains this value."""
        return replace(self, high=max(self.high, value))

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """The ends, margin included."""
        margin = MARGIN * max(abs(self.low), abs(self.high))
        return self.low - margin, self.high + margin

    def __str__(self) -> str:
        return f"{self.low:.4g} to {self.high:.4g}"


def range_of(name: str, values: Array) -> CovariateRange:
    """The range of the values (n,) of a covariate; for a heading the shortest arc that contains them all."""
    if name not in HEADINGS:
        return CovariateRange(float(values.min()), float(values.max()))
    around = np.sort(values % TURN)
    gaps = np.diff(around, append=around[0] + TURN)
    widest = int(np.argmax(gaps))
    if gaps[widest] <= WHOLE_TURN:
        return CovariateRange(-np.pi, np.pi, heading=True)
    low = float(around[(widest + 1) % len(around)])
    low -= TURN * (low >= np.pi)
    return CovariateRange(low, low + TURN - float(gaps[widest]), heading=True)
