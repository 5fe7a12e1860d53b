# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The interval of a reported parameter is compared with the truth only where both have the same meaning."""

from __future__ import annotations

from math import expm1
from typing import Any

import pytest

from benchmarks.blind.true_parameter import covers


def truth(kind: str, value: float, unit: str, **other: Any) -> dict[str, Any]:
    record = {"kind": kind, "value": value, "unit": unit, "form": "constant", "covariates": ["session"]}
    return {**record, "friction": 0.25, "engine": "own", **other}


def covered(
    record: dict[str, Any], value: float, form: str = "constant", covariate: str = "model_inputs"
) -> bool | None:
    """Of an interval of 1 % about a value."""
    low, high = sorted((0.99 * value, 1.01 * value))
    reported = {
        "mechanism": record["kind"],
        "form": form,
        "covariate": covariate,
        "parameter": {"low": low, "high": high},
    }
    return covers(record, record, reported)


@pytest.mark.parametrize(("kind", "value", "unit", "parameter"), [
    ("contact_friction", -0.2, "1", -0.2),
    ("centre_of_friction", -0.01, "m", 0.01),
    ("anisotropic_friction", -0.3, "1", 0.3),
    ("body_anisotropy", -0.3, "1", 0.3),
    ("tilted_surface", -0.05, "N/N", 0.2),
    ("tilted_surface", 0.05, "of the weight", 0.2),
    ("surface_friction", -0.4, "1", expm1(-0.4)),
    ("surface_friction", -0.4, "of its value", -0.4),
    ("clock_offset", 0.015, "s", 0.015),
    ("frame_rotation", -0.03, "rad", -0.03),
])  # fmt: skip
def test_constant_parameters_are_compared_in_the_unit_of_the_library(
    kind: str, value: float, unit: str, parameter: float
) -> None:
    record = truth(kind, value, unit)
    assert covered(record, parameter) is True
    assert covered(record, 1.1 * parameter) is False
    assert covered(record, -parameter) is False
    assert covered(record, parameter, "step", "session") is True


@pytest.mark.parametrize(("kind", "unit"), [
    ("pressure_spread", "1"), ("pressure_spread", "of the load's rms radius"), ("anisotropic_friction", "of the mean"),
    ("frame_shift", "m"), ("wrench_bias", "N"), ("ballast", "kg"),
])  # fmt: skip
def test_parameters_of_another_meaning_are_not_compared(kind: str, unit: str) -> None:
    assert covered(truth(kind, 0.1, unit), 0.1) is None


def test_truths_that_lack_what_a_comparison_needs_are_not_compared() -> None:
    tilted, centre = truth("tilted_surface", 0.05, "N/N"), truth("centre_of_friction", 0.01, "m")
    assert covered({key: value for key, value in tilted.items() if key != "friction"}, 0.2) is None
    assert covered({key: value for key, value in centre.items() if key != "engine"}, 0.01) is None
    record = truth("contact_friction", 0.2, "1")
    reported = {"mechanism": "tilted_surface", "form": "constant", "covariate": "session"}
    assert covers(record, record, {**reported, "parameter": {"low": 0.1, "high": 0.3}}) is None
    assert covers(record, record, {**reported, "mechanism": "contact_friction", "parameter": None}) is None


@pytest.mark.parametrize(("form", "covariates", "reported_form", "covariate", "share"), [
    ("constant", ["session"], "linear", "session", None),
    ("constant", ["session"], "step", "push_index", None),
    ("step", ["push_index"], "step", "push_index", 1.0),
    ("step", ["push_index"], "step", "elapsed_time", 1.0),
    ("step", ["topic:/room/humidity"], "step", "topic:/room/humidity", 1.0),
    ("step", ["topic:/room/humidity"], "step", "push_index", None),
    ("step", ["push_index"], "linear", "push_index", None),
    ("linear", ["elapsed_time"], "linear", "elapsed_time", 0.9),
    ("linear", ["elapsed_time"], "linear", "slid_distance", 0.9),
    ("linear", ["elapsed_time"], "step", "elapsed_time", None),
    ("linear", ["topic:/room/humidity"], "linear", "topic:/room/humidity", None),
    ("linear", ["velocity"], "linear", "velocity", None),
    ("saturating", ["elapsed_time"], "linear", "elapsed_time", None),
    ("saturating", ["elapsed_time"], "logarithmic", "elapsed_time", None),
])  # fmt: skip
def test_forms_must_agree(
    form: str, covariates: list[str], reported_form: str, covariate: str, share: float | None
) -> None:
    record = truth("contact_friction", 0.2, "1", form=form, covariates=covariates)
    saturating = {**record, "course": "saturating"}  # the course decides where a truth has one
    assert form == "step" or covered(saturating, 0.2 * (share or 1.0), reported_form, covariate) is None
    assert covered(record, 0.2 * (share or 1.0), reported_form, covariate) is (None if share is None else True)
