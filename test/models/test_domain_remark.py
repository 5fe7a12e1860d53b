# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""In words, why a push is outside the domain of the training data."""

from __future__ import annotations

from dataclasses import replace

import drifting_models
import numpy as np
import pytest
from synthetic import square_pushes, square_rig

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.request import domain_remark, own_window
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import empty_table
from push_predictor.types import Array

CORNERS = np.array([[0.04, 0.04, 0.25], [-0.04, 0.04, 0.25], [-0.04, -0.04, 0.25], [0.04, -0.04, 0.25]])


@pytest.fixture(scope="module")
def model() -> PushModel:
    return train_model(*square_pushes(60), "gp", name="gp")


def remark(model: PushModel, inputs: Array, **covariates: Array) -> str:
    push = Push(inputs, np.full(len(inputs), 0.2), covariates)
    return domain_remark(model, push, model.predict_rows(inputs, push.duration, covariates).in_domain)


def test_a_push_inside_the_domain_needs_no_remark(model: PushModel) -> None:
    assert remark(model, model.training.inputs) == ""
    assert remark(model, np.empty((0, 3))) == ""


def test_the_limits_are_those_of_the_training_pushes(model: PushModel) -> None:
    velocity, _, angle = model.training.inputs.T
    assert model.input_limits.velocity == (velocity.min(), velocity.max())
    assert model.input_limits.angle == (angle.min(), angle.max())


@pytest.mark.parametrize(("column", "value", "name"), [(0, 0.5, "velocity"), (0, 1e-4, "velocity"), (2, -1.5, "angle")])
def test_the_remark_names_value_and_range(model: PushModel, column: int, value: float, name: str) -> None:
    push = model.training.inputs[:1].copy()
    push[0, column] = value
    low, high = getattr(model.input_limits, name)
    unit = {"velocity": "m/s", "angle": "rad"}[name]
    expected = f"out of domain: {name} {value:.4g} {unit}, training covers {low:.4g} to {high:.4g} {unit}"
    assert remark(model, push) == expected


def test_the_remark_about_a_batch_counts_and_names_the_first(model: PushModel) -> None:
    pushes = model.training.inputs[:5].copy()
    pushes[[2, 4], 0] = 0.5
    assert remark(model, pushes).startswith("out of domain: 2 of 5 pushes, first push 2: velocity 0.5 m/s")


def test_a_contact_without_training_pushes_is_named() -> None:
    table, rig = square_pushes(60)
    half = table.take(np.flatnonzero(table.inputs[:, 1] % 0.25 < 0.12))  # the first half of each side
    model = train_model(half, rig, "gp", name="half", options=TrainingOptions(mean="zero"))
    inside = half.inputs[:1].copy()
    inside[0, 1] = 0.2
    assert remark(model, inside) == "out of domain: contact 0.2, beyond those of the training pushes"


def test_a_covariate_outside_its_range_is_named_with_its_unit() -> None:
    table = drifting_models.pushes(20, 0)
    model = train_model(table, square_rig(), "analytical", name="drifting")
    model = drifting_models.extended(model, drifting_models.slippery(0.1))
    inputs = table.inputs[:1]
    assert remark(model, inputs, elapsed_time=np.array([500.0])) == ""
    late = remark(model, inputs, elapsed_time=np.array([2000.0]))
    assert late == "out of domain: covariate elapsed_time 2000 s, training covers 0 to 1000 s"
    times = np.array([500.0, 1500.0, 2000.0])
    of_batch = remark(model, np.repeat(inputs, 3, axis=0), elapsed_time=times)
    assert of_batch.startswith("out of domain: 2 of 3 pushes, first push 1: covariate elapsed_time 1500 s")


def test_an_edge_without_training_pushes_is_named_for_any_push_of_a_batch() -> None:
    table = drifting_models.pushes(20, 0)
    half = table.take(np.flatnonzero(table.inputs[:, 1] < 0.5))
    by_edge = replace(drifting_models.slippery(0.1), basis=DriverBasis("category", ("edge",), levels=(0.0, 1.0)))
    model = drifting_models.extended(train_model(half, square_rig(), "analytical", name="half"), by_edge)
    inputs = half.inputs[:2].copy()
    inputs[1, 1] = 0.8
    assert (
        remark(model, inputs) == "out of domain: 1 of 2 pushes, first push 1: covariate edge 3, training covers 0 to 1"
    )


def test_a_prior_model_has_limits_of_its_own() -> None:
    rig = replace(square_rig(), support_points=CORNERS)
    model = train_model(empty_table(), rig, "prior", name="prior")
    assert model.input_limits.velocity == (0.0, 0.15) and model.input_limits.angle == (-1.4, 1.4)
    inputs = np.array([[0.02, 0.1, 0.2], [0.16, 0.1, 0.2], [0.02, 0.1, -1.41], [0.02, 0.1, 1.41]])
    assert model.in_domain(inputs).tolist() == [True, False, False, False]


def test_duration_zero_means_the_models_own_window(model: PushModel) -> None:
    assert own_window(model, 0.0) == model.usual_duration == pytest.approx(np.median(model.training.duration))
    assert own_window(model, 0.19) == 0.19 and own_window(model, -0.2) == -0.2
