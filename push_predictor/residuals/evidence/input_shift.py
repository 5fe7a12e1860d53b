# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Whether new pushes lie outside the inputs that a model was trained on, or in a part of them only.

Outside them the model's error is extrapolation: a trace goes on there with mechanics, and noise in proportion to the
travel. About the rest of them the new pushes say nothing. Mechanics that learnt no function of the inputs do not
extrapolate to other contacts and angles, only to other speeds, at which noise and inertia differ.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.models.predictors import GaussianProcessPredictor, MechanicsPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.types import Array, BoolArray

SPEED_MARGIN = 0.15  # relative: speeds are estimated from few samples
ANGLE_MARGIN = 0.1  # rad: guards against the noise of an estimated angle
CONTACT_MARGIN = 0.03  # of the perimeter: guards against gaps between contacts that lie densely
WIDEST_GAPS = 2.0  # of training between contacts: guards against new contacts amid sparse ones
ONE_SIDED = 0.2  # share of training outside the new inputs from which these are a part of them only
NOTABLE = 0.05  # share of the windows outside from which an input has shifted


@dataclass(frozen=True)
class ShiftedInput:
    """An input whose new values leave those of training, or are a part of them only: both ranges.

    share_outside: of the new windows outside those of training. share_unvisited: of the training windows outside the
    new ones.
    """

    covariate: str
    training: tuple[float, float]
    now: tuple[float, float]
    share_outside: float
    share_unvisited: float = 0.0

    @property
    def extrapolates(self) -> bool:
        """Whether new windows lie outside, rather than in a part only."""
        return self.share_outside >= NOTABLE


@dataclass(frozen=True, eq=False)
class InputShift:
    """The inputs that have shifted, and the windows (n,) outside in any of them.

    Those that extrapolate come first, of each kind the one with the largest share.
    """

    inputs: tuple[ShiftedInput, ...]
    outside: BoolArray


def input_shift(model: PushModel, table: PushTable) -> InputShift:
    """Compare the inputs of n new windows with those of a model's training windows."""
    training = model.training.inputs
    outside = _outside(table.inputs, training, model.rig.outline.rotational_symmetry)
    if not model.base.predictor.learnt:
        nowhere = np.zeros(len(table), dtype=np.bool_)
        outside |= {"contact": nowhere, "angle": nowhere}
    unvisited = _outside(training, table.inputs, 1)  # real sides differ, although a model takes them for the same
    every = [
        ShiftedInput(
            name,
            _range(training[:, k]),
            _range(table.inputs[:, k]),
            float(outside[name].mean()),
            float(unvisited[name].mean()),
        )
        for k, name in enumerate(outside)
    ]
    shifted = [each for each in every if each.extrapolates or each.share_unvisited >= ONE_SIDED]
    shifted.sort(key=lambda each: -each.share_outside if each.extrapolates else 1.0 - each.share_unvisited)
    rows = np.zeros(len(table), dtype=np.bool_)
    for each in shifted:
        if each.extrapolates:
            rows |= outside[each.covariate]
    return InputShift(tuple(shifted), rows)


def among(inputs: Array, others: Array) -> BoolArray:
    """Which of n inputs (n, 3) lie among others, on the same sides of the outline; all, if nearly all do.

    The sides of a real slider differ, although a model takes symmetric ones for the same.
    """
    outside = np.any(list(_outside(inputs, others, 1).values()), axis=0)
    return ~outside if outside.mean() >= ONE_SIDED else np.ones(len(inputs), dtype=np.bool_)


def _outside(inputs: Array, known: Array, symmetry: int) -> dict[str, BoolArray]:
    """By input, which of n inputs (n, 3) lie outside the known ones; symmetry: of the outline, 0 for a circle."""
    return {
        "velocity": _beyond(inputs[:, 0], known[:, 0], SPEED_MARGIN * float(known[:, 0].max())),
        "contact": _apart(symmetry, inputs[:, 1], known[:, 1]),
        "angle": _beyond(inputs[:, 2], known[:, 2], ANGLE_MARGIN),
    }


def _beyond(values: Array, known: Array, margin: float) -> BoolArray:
    return np.asarray((values < known.min() - margin) | (values > known.max() + margin))


def _apart(order: int, contact: Array, known: Array) -> BoolArray:
    """Contacts (n,) far from every known one; the order of symmetry that a model folds is folded here too."""
    if order == 0:
        return np.zeros(len(contact), dtype=np.bool_)
    places = np.sort(np.mod(known * order, 1.0))
    margin = max(CONTACT_MARGIN * order, WIDEST_GAPS * _usual_gap(places))
    away = np.mod(contact * order, 1.0)[:, None] - places[None, :]
    return np.asarray(np.min(np.abs(away - np.round(away)), axis=1) > margin)


def _usual_gap(places: Array) -> float:
    """The 90th percentile of the gaps between neighbouring training contacts on the closed outline."""
    return float(np.quantile(np.diff(np.append(places, places[0] + 1.0)), 0.9))


def _range(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def about_mechanics(model: PushModel) -> PushModel:
    """The model trained again on its own training windows, with fitted mechanics as its mean.

    A learnt function of the inputs knows nothing outside them; mechanics do. Unchanged if it has mechanics already, or
    effects.
    """
    predictor = model.predictor
    if not (isinstance(predictor, GaussianProcessPredictor) and predictor.absorbs):
        return model
    options = TrainingOptions(seed=model.provenance.seed, mean="mechanics")
    sources = model.provenance.sources
    return train_model(model.training, model.rig, model.kind, name=model.name, sources=sources, options=options)


def widened(evidence: Evidence, model: PushModel, shift: InputShift) -> Evidence:
    """The evidence with predicted deviations in proportion to the tip's travel, where that is beyond training.

    Unchanged if those of the model grow with the travel already.
    """
    if _grows(model) or not any(each.covariate == "velocity" and each.extrapolates for each in shift.inputs):
        return evidence
    longest = float(np.max(model.training.inputs[:, 0] * model.training.duration))
    travel = evidence.table.inputs[:, 0] * evidence.table.duration
    factor = np.where(shift.outside, np.maximum(travel / longest, 1.0), 1.0)
    return replace(evidence, whitener=evidence.whitener / factor[:, None, None])


def _grows(model: PushModel) -> bool:
    """Whether predicted deviations grow with the travel: not if outcomes were learnt as they are, nor of mechanics."""
    base = model.predictor.base
    if isinstance(base, GaussianProcessPredictor):
        return base.scaling.travel is not None
    return not isinstance(base, MechanicsPredictor)
