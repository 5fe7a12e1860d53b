# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A rich basis of velocity, contact and angle: what a base model could have learnt from its own inputs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Literal, get_args

import numpy as np

from push_predictor.geometry.outline import Outline
from push_predictor.models.features import EDGE_SPACING, push_features
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.types import Array

Kind = Literal["driven", "speed", "constant"]  # an effect depends on another covariate, on the speed, or on neither

DEGREES = (5, 4, 3, 2, 1)
PUSHES_PER_COLUMN = 5
VARIES = 0.01  # standard deviation of log velocity; below it the table has one speed


@dataclass(frozen=True, eq=False)
class InputsBasis:
    """The basis at n windows, the constant included.

    columns (n, m): contact, angle and speed. without_speed (n, k): contact and angle alone. learnt: the base model was
    fitted to its inputs. absorbs: a refit of it learns effects in its own inputs; one about mechanics keeps these as
    they are. folds: it folds the outline's sides onto one. knows_speed: it was trained at several speeds.
    """

    columns: Array
    without_speed: Array
    learnt: bool = True
    folds: bool = False
    knows_speed: bool = False
    absorbs: bool = True

    @cached_property
    def residualizers(self) -> dict[Kind, Residualizer]:
        """What regresses the controls of each kind of effect out."""
        return {kind: Residualizer(controls_for(kind, self)) for kind in get_args(Kind)}


def inputs_basis(model: PushModel, table: PushTable) -> InputsBasis:
    """The basis of a table's inputs, of the highest degree that its number of pushes supports."""
    base, outline = model.base, model.rig.outline
    most = len(table.pushes) // PUSHES_PER_COLUMN
    bases = (_of_degree(outline, table.inputs, degree) for degree in DEGREES)
    columns, without_speed = next((b for b in bases if b[0].shape[1] <= most), _of_degree(outline, table.inputs, 1))
    learnt = base.predictor.learnt
    speed = _log_speed(base.training.inputs)
    return InputsBasis(
        columns,
        without_speed,
        learnt,
        learnt and outline.rotational_symmetry != 1,
        learnt and float(speed.std()) > VARIES,
        base.predictor.absorbs,
    )


def controls_for(kind: Kind, inputs: InputsBasis) -> Array:
    """Controls (n, m) for a kind of effect: none for an effect that is itself a function of the inputs."""
    if kind == "constant":
        return inputs.columns[:, :0]
    return inputs.without_speed if kind == "speed" else inputs.columns


def _of_degree(outline: Outline, inputs: Array, degree: int) -> tuple[Array, Array]:
    features = push_features(outline, inputs)[:, 1:]
    place, kinds = _place(outline, features[:, :-1])
    angle = features[:, -1]
    smooth = np.column_stack([_powers(place, angle, degree)])
    without_speed = np.column_stack([smooth * (kinds == kind)[:, None] for kind in np.unique(kinds)])
    speed = _log_speed(inputs)
    if speed.std() <= VARIES:
        return without_speed, without_speed
    speed = (speed - speed.mean()) / speed.std()
    with_speed = np.column_stack([_powers(place, angle, max(degree - 2, 1)) * speed[:, None], speed**2])
    return np.column_stack([without_speed, with_speed]), without_speed


def _place(outline: Outline, contact: Array) -> tuple[Array, Array]:
    """Smooth coordinates (n, k) of the contact, and the number (n,) of its kind of side."""
    n = len(contact)
    if outline.semi_axes is not None or not contact.shape[1]:
        return contact, np.zeros(n)
    side = np.floor(contact[:, 0] / EDGE_SPACING + 1e-9)
    return 2.0 * (contact - EDGE_SPACING * side[:, None]) - 1.0, side


def _powers(place: Array, angle: Array, degree: int) -> Array:
    coordinates = np.column_stack([place, angle])
    exponents = (e for e in product(range(degree + 1), repeat=coordinates.shape[1]) if sum(e) <= degree)
    return np.column_stack([np.prod(coordinates ** np.array(e), axis=1) for e in exponents])


def _log_speed(inputs: Array) -> Array:
    return np.asarray(np.log(np.maximum(inputs[:, 0], 1e-6)))
