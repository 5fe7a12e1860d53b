# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The covariates at which the map of an extended model is drawn. A map varies contact and angle only."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from push_predictor.geometry.frames import wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.models.effects.covariates import HEADINGS, UNITS
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

OF_SLIDER, OF_PUSH = HEADINGS


def fixed_covariates(model: PushModel, table: PushTable) -> dict[str, float]:
    """The median in the table of each covariate that the model takes; empty if it takes none.

    For a heading it is the value nearest to the mean direction. If the slider's heading is known, it is fixed and the
    push's heading follows from it. Raises KeyError if the table lacks a covariate that the model needs.
    """
    known, given = model.continued(table).covariates, [name for name in model.defaults if name in table.covariates]
    names = [OF_SLIDER if name == OF_PUSH and OF_SLIDER in known else name for name in (*model.needs, *given)]
    return {name: _middle(name, known[name]) for name in names}


def map_covariates(outline: Outline, fixed: Mapping[str, float], inputs: Array) -> dict[str, Array]:
    """The covariates (n,) of the pushes (n, 3) of a map, with these fixed."""
    columns = {name: np.full(len(inputs), value) for name, value in fixed.items()}
    if OF_SLIDER in fixed and OF_PUSH not in fixed:
        normal = outline.inward_normal(inputs[:, 1])
        columns[OF_PUSH] = wrap_angle(fixed[OF_SLIDER] + np.arctan2(normal[:, 1], normal[:, 0]) + inputs[:, 2])
    return columns


def fixed_covariates_text(model: PushModel, fixed: Mapping[str, float]) -> str:
    """Sentences for a caption: the values at which a model's map is drawn, and what that means; empty without them."""
    if not fixed:
        return ""
    values = " and ".join(_value(*pair) for pair in fixed.items())
    sentences = [f"The map of {model.name} is drawn at {values}, the median of these windows."]
    if headings := [name for name in fixed if name in HEADINGS]:
        follows = f" ({OF_PUSH} follows from it)" if OF_PUSH in model.needs and OF_PUSH not in fixed else ""
        sentences.append(f"The {headings[0]} is the one nearest to the mean direction{follows}.")
        sentences.append("At another heading the map differs.")
    for name, value in fixed.items():
        known = model.covariate_ranges.get(name)
        if known is not None and not known.contains(np.array([value]))[0]:
            sentences.append(f"Nothing is drawn: the model was extended on {name} from {known}.")
    return " ".join(sentences)


def _value(name: str, value: float) -> str:
    return f"{name} {value:.3g} {UNITS[name]}" if name in UNITS else f"{name} {value:.3g}"


def _middle(name: str, values: Array) -> float:
    if name not in HEADINGS:
        return float(np.sort(values)[(len(values) - 1) // 2])
    mean = np.arctan2(np.sin(values).mean(), np.cos(values).mean())
    return float(values[np.argmin(np.abs(wrap_angle(values - mean)))])
