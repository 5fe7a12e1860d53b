# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The covariates that every window may have: what each is, its unit, and its name in prose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

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
