"""At which covariates the map of an extended model is drawn: a map shows contact and angle, all else is held."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from push_predictor.geometry.frames import wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.models.effects.covariate_range import HEADINGS
from push_predictor.models.push_model import PushModel
from push_predictor.models.request import UNITS
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

OF_SLIDER, OF_PUSH = HEADINGS


def fixed_covariates(model: PushModel, table: PushTable) -> dict[str, float]:
    """For each covariate that the model needs, the middle one of the table's values; empty where it needs none.

    Of a heading it is the one nearest to their mean direction. Where the slider's heading is known, that one is held
    and the push's follows from it. Raises KeyError where the table lacks a covariate.
    """
    names = [OF_SLIDER if name == OF_PUSH and OF_SLIDER in table.covariates else name for name in model.needs]
    return {name: _middle(name, table.covariates[name]) for name in names}


def map_covariates(outline: Outline, held: Mapping[str, float], inputs: Array) -> dict[str, Array]:
    """The covariates (n,) of the pushes (n, 3) of a map, with these held."""
    columns = {name: np.full(len(inputs), value) for name, value in held.items()}
    if OF_SLIDER in held and OF_PUSH not in held:
        normal = outline.inward_normal(inputs[:, 1])
        columns[OF_PUSH] = wrap_angle(held[OF_SLIDER] + np.arctan2(normal[:, 1], normal[:, 0]) + inputs[:, 2])
    return columns


def fixed_covariates_text(model: PushModel, held: Mapping[str, float]) -> str:
    """Sentences for a caption: at which values a model's map is drawn, and what that leaves out; empty for none."""
    if not held:
        return ""
    told = [f"The map of {model.name} is drawn at {' and '.join(_value(*pair) for pair in held.items())}:"]
    told.append("the middle of these windows' values.")
    if headings := [name for name in held if name in HEADINGS]:
        follows = f" ({OF_PUSH} follows from it)" if OF_PUSH in model.needs and OF_PUSH not in held else ""
        told.append(f"The {headings[0]} is one of many, that nearest to their mean direction{follows};")
        told.append("at another the map differs.")
    for name, value in held.items():
        known = model.covariate_ranges.get(name)
        if known is not None and not known.holds(np.array([value]))[0]:
            told.append(f"Nothing is drawn: the model was extended on {name} from {known}.")
    return " ".join(told)


def _value(name: str, value: float) -> str:
    return f"{name} {value:.3g} {UNITS[name]}" if name in UNITS else f"{name} {value:.3g}"


def _middle(name: str, values: Array) -> float:
    if name not in HEADINGS:
        return float(np.sort(values)[(len(values) - 1) // 2])
    mean = np.arctan2(np.sin(values).mean(), np.cos(values).mean())
    return float(values[np.argmin(np.abs(wrap_angle(values - mean)))])
