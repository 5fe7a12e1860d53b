# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Measured pushes of a square: textbook parameters explain them in the documented frame and in no flipped one."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from push_predictor.evaluation.metrics import nmse
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.mechanics.fitted import FittedMechanics, analytical_mechanics

AS_CONTRACT, MIRRORED = (1, 1, 1, 1), (-1, -1, -1, -1)


@pytest.fixture(scope="module")
def square_pushes(measured_data):
    """Inputs, durations and outcomes of all 3500 windows in the documented frame: contact on edge 0, dy to the left."""
    with np.load(measured_data / "mit_square" / "pushes_3500.npz") as table:
        inputs = np.column_stack([np.full(len(table["c"]), 0.02), table["c"] / 4.0, table["beta"]])
        outcomes = np.column_stack([table["dx"], -table["dy"], table["dtheta"]])
    return inputs, np.full(len(inputs), 0.2), outcomes


def score(model: FittedMechanics, inputs: np.ndarray, duration: np.ndarray, outcomes: np.ndarray) -> float:
    """NMSE, summed over the three outputs."""
    predicted = model.displacement(inputs, duration)
    return float(np.sum(nmse(predicted, outcomes, outcomes.mean(axis=0))))


def flipped_score(pushes: tuple[np.ndarray, np.ndarray, np.ndarray], flip: tuple[int, ...]) -> float:
    inputs, duration, outcomes = pushes
    angle, contact, dy, dtheta = flip
    along = inputs[:, 1] if contact > 0 else 0.25 - inputs[:, 1]
    turned = np.column_stack([inputs[:, 0], along, angle * inputs[:, 2]])
    return score(analytical_mechanics(shape_outline("rect1"), 0.00475), turned, duration, outcomes * [1, dy, dtheta])


def test_textbook_parameters_explain_the_measured_square(square_pushes):
    assert flipped_score(square_pushes, AS_CONTRACT) == pytest.approx(0.23, abs=0.005)


def test_the_exact_mirror_is_as_good(square_pushes):
    assert flipped_score(square_pushes, MIRRORED) == pytest.approx(flipped_score(square_pushes, AS_CONTRACT), abs=1e-4)


def test_every_other_flip_is_far_off(square_pushes):
    some = tuple(values[::7] for values in square_pushes)
    for flip in product((1, -1), repeat=4):  # of angle, contact, dy, dtheta
        assert flip in (AS_CONTRACT, MIRRORED) or flipped_score(some, flip) > 1.6, flip
