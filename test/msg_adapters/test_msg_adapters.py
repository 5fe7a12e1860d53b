# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Conversions between ROS messages and the library's types lose nothing and reject bad values by field."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from hypothesis import given
from hypothesis import strategies as st
from made_up_windows import made_up_windows
from rclpy.serialization import deserialize_message, serialize_message

from msg_adapters import ns_to_stamp, stamp_to_ns
from msg_adapters.diagnostics import diagnostic_array, diagnostic_status
from msg_adapters.markers import Sheet, confidence_ellipse, prediction_markers
from msg_adapters.predictions import (
    PushQuery,
    RefusedError,
    extend_batch_response,
    fill_response,
    prediction_from_response,
    push_from_request,
    query_from_batch_request,
    query_to_batch_request,
    query_to_request,
    refuse,
)
from msg_adapters.residuals import residual_to_message, residuals_to_table
from msg_adapters.rigs import rig_from_message, rig_to_message
from push_predictor.error_codes import ErrorCode
from push_predictor.errors import RequestError, RigError
from push_predictor.geometry.frames import to_world
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.prediction import Prediction
from push_predictor.models.request import PushRequest
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor_interfaces.msg import PushResidual

CORRELATIONS = st.floats(-0.95, 0.95)
SPREADS = st.floats(1e-5, 1e-1)


def over_the_wire(message):
    return deserialize_message(serialize_message(message), type(message))


# --- stamps and errors ------------------------------------------------------------------------------------------


@given(st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1))
def test_a_stamp_survives_to_the_nanosecond(nanoseconds):
    assert stamp_to_ns(over_the_wire(ns_to_stamp(nanoseconds))) == nanoseconds


def test_rejects_a_stamp_beyond_32_bit_seconds():
    with pytest.raises(RequestError, match="stamp"):
        ns_to_stamp(2**31 * 10**9)


# --- predictions ------------------------------------------------------------------------------------------------


def some_prediction(count: int, seed: int = 0) -> Prediction:
    rng = np.random.default_rng(seed)
    return Prediction(
        rng.normal(size=(count, 3)),
        rng.normal(size=(count, 3, 3)),
        rng.normal(size=(count, 3, 3)),
        rng.random(count) < 0.5,
    )


def assert_same(left: Prediction, right: Prediction) -> None:
    for name in ("mean", "covariance", "process_covariance", "in_domain"):
        np.testing.assert_array_equal(getattr(left, name), getattr(right, name))


@given(st.integers(0, 5), st.integers(0, 1000))
def test_a_batch_of_predictions_survives_bit_for_bit(count, seed):
    from push_predictor_interfaces.srv import PredictPushBatch

    prediction = some_prediction(count, seed)
    response = PredictPushBatch.Response(success=True)
    extend_batch_response(response, prediction)
    response = over_the_wire(response)
    assert_same(prediction_from_response(response), prediction)


def test_one_prediction_survives_bit_for_bit():
    from push_predictor_interfaces.srv import PredictPush

    prediction = some_prediction(1)
    response = PredictPush.Response()
    fill_response(response, prediction)
    response = over_the_wire(response)
    assert response.success
    assert_same(prediction_from_response(response), prediction)
    assert np.array_equal(response.covariance, prediction.covariance[0].ravel())  # row-major


def test_a_refusal_contains_its_reason_and_no_number():
    from push_predictor_interfaces.srv import PredictPush, PredictPushBatch

    half_written = PredictPush.Response()
    fill_response(half_written, some_prediction(1))
    response = refuse(half_written, "velocity: nan", ErrorCode.INVALID_REQUEST)
    assert not np.any(response.mean) and not np.any(response.covariance)
    assert not response.success and response.error_code == PredictPush.Response.INVALID_REQUEST
    assert len(refuse(PredictPushBatch.Response(), "x", ErrorCode.TOO_LARGE).mean) == 0
    with pytest.raises(RefusedError, match="velocity: nan"):
        prediction_from_response(response)


@given(st.integers(0, 4), st.integers(0, 3))
def test_a_batch_query_survives_with_its_covariates(count, width):
    rng = np.random.default_rng(count * 10 + width)
    covariates = {f"c{k}": rng.normal(size=count) for k in range(width)}
    request = query_to_batch_request(PushQuery("m", rng.normal(size=(count, 3)), 0.2, covariates))
    query = query_from_batch_request(over_the_wire(request))
    assert query.model == "m"
    assert query.inputs.tolist() == np.array([request.velocity, request.contact, request.angle]).T.tolist()
    assert {name: column.tolist() for name, column in query.covariates.items()} == {
        name: column.tolist() for name, column in covariates.items()
    }
    first_push = list(request.covariate_values[:width])
    assert first_push == [column[0] for column in covariates.values() if count]


def test_one_push_survives_with_its_covariates():
    request = over_the_wire(query_to_request("m", np.array([0.05, 0.1, -0.2]), 0.2, {"a": 1.0, "b": 2.0}))
    assert request.model == "m"
    assert push_from_request(request) == PushRequest(0.05, 0.1, -0.2, 0.2, {"a": 1.0, "b": 2.0})


# --- residuals --------------------------------------------------------------------------------------------------


PREDICTED = np.array([0.01, 0.002, 0.1])


def residual_of(covariance: np.ndarray, difference: np.ndarray, in_domain: bool = False) -> PushResidual:
    window = replace(
        made_up_windows(1)[0], push_id="run1/3", index=4, end=10**18 + 7, displacement=PREDICTED + difference
    )
    return over_the_wire(residual_to_message("vhgp", window, PREDICTED, covariance, in_domain, "lab"))


@given(st.lists(SPREADS, min_size=3, max_size=3), CORRELATIONS, st.lists(st.floats(-4.0, 4.0), min_size=3, max_size=3))
def test_the_standardised_residual_has_the_mahalanobis_length(spreads, correlation, units):
    correlations = np.eye(3)
    correlations[0, 1] = correlations[1, 0] = correlation
    covariance = correlations * np.outer(spreads, spreads)
    message = residual_of(covariance, np.array(units) * spreads)
    gap, standardised = np.array(message.observed) - message.predicted, np.array(message.standardised)
    assert standardised @ standardised == pytest.approx(gap @ np.linalg.solve(covariance, gap), rel=1e-6, abs=1e-9)
    assert standardised[0] == pytest.approx(gap[0] / spreads[0], rel=1e-9)


def test_residuals_come_back_as_rows_of_a_table_with_their_covariates():
    windows = [replace(window, covariates={"slider_heading": 0.5 + k}) for k, window in enumerate(made_up_windows(3))]
    sent = [over_the_wire(residual_to_message("vhgp", w, PREDICTED, np.eye(3), True, "world")) for w in windows]
    found, table = residuals_to_table(sent), windows_to_table(windows)
    for name in ("inputs", "duration", "outcomes", "push_id"):
        np.testing.assert_array_equal(getattr(found, name), getattr(table, name))
    assert found.covariates.keys() == {"slider_heading"}
    np.testing.assert_array_equal(found.covariates["slider_heading"], [0.5, 1.5, 2.5])
    sent[1].covariate_values = []
    with pytest.raises(RequestError, match="covariate_values length: 0 is not accepted, give 1 values"):
        residuals_to_table(sent)


def test_a_residual_survives():
    covariance, window = np.diag([1e-6, 4e-6, 1e-2]), made_up_windows(1)[0]
    message = residual_of(covariance, np.array([1e-3, -4e-3, 0.2]))
    assert message.header.frame_id == "lab"
    np.testing.assert_allclose(message.standardised, [1.0, -2.0, 2.0])
    assert stamp_to_ns(message.header.stamp) == 10**18 + 7
    assert message.in_domain is False and residual_of(covariance, np.zeros(3), in_domain=True).in_domain
    assert (message.push_id, message.window, message.model) == ("run1/3", 4, "vhgp")
    for name in ("velocity", "contact", "angle", "duration"):
        assert getattr(message, name) == getattr(window, name)
    np.testing.assert_array_equal(message.predicted, PREDICTED)
    np.testing.assert_array_equal(message.observed, PREDICTED + [1e-3, -4e-3, 0.2])
    np.testing.assert_array_equal(message.covariance, covariance.ravel())


def test_rejects_a_covariance_that_is_not_positive_definite():
    with pytest.raises(RequestError, match=r"covariance.*positive definite"):
        residual_of(np.diag([1.0, 1.0, -1.0]), np.ones(3))


# --- the rig ----------------------------------------------------------------------------------------------------


SUPPORT = np.array([[0.02, 0.0, 0.5], [-0.02, 0.01, 0.5]])
RIGS = {
    "square": Rig("rect1", shape_outline("rect1"), 0.00475, "abs", 0.837, SUPPORT, 0.3, 0.15),
    "unknown": Rig("hex", shape_outline("hex"), 0.005, "pu"),
    "circle": Rig("ellip1", shape_outline("ellip1"), 0.005, "pu", contact_friction=0.2),
    "ellipse": Rig("ellip3", shape_outline("ellip3"), 0.005, "pu", surface_friction=0.2),
}


@pytest.mark.parametrize("name", RIGS)
def test_a_rig_survives(name):
    rig = RIGS[name]
    assert rig_from_message(over_the_wire(rig_to_message(rig)), "topic rig").to_record() == rig.to_record()


def test_an_ellipse_with_axes_elsewhere_survives():
    outline = shape_outline("ellip2")
    moved = Outline(to_world(outline.vertices, np.array([0.001, 0.002, 0.5])), outline.semi_axes, (0.001, 0.002, 0.5))
    rig = replace(RIGS["ellipse"], outline=moved)
    assert rig_from_message(rig_to_message(rig), "topic rig").to_record() == rig.to_record()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("outline", [0.0, 1.0, 2.0]),
        ("outline", []),
        ("pusher_radius", 0.0),
        ("object_mass", -1.0),
        ("contact_friction", float("nan")),
        ("support_points", [0.1, 0.2]),
        ("semi_axes", [float("nan"), 0.1]),
    ],
)
def test_a_bad_rig_is_refused_with_the_source(field, value):
    message = rig_to_message(RIGS["square"])
    setattr(message, field, value)
    with pytest.raises(RigError, match="topic rig"):
        rig_from_message(message, "topic rig")


# --- diagnostics ------------------------------------------------------------------------------------------------


def test_a_status_names_its_values():
    values = {"p99_us": 123.456789, "models": ["a", "b"], "last": None, "active": True, "served": 12}
    status = diagnostic_status("/cell/server", "predictions", DiagnosticStatus.WARN, "one model failed", values, "rig")
    array = over_the_wire(diagnostic_array(3 * 10**9 + 5, status))
    assert stamp_to_ns(array.header.stamp) == 3 * 10**9 + 5
    (back,) = array.status
    assert (back.name, back.level, back.message, back.hardware_id) == (
        "/cell/server: predictions",
        DiagnosticStatus.WARN,
        "one model failed",
        "rig",
    )
    assert {pair.key: pair.value for pair in back.values} == {
        "p99_us": "123.457",
        "models": "a, b",
        "last": "-",
        "active": "true",
        "served": "12",
    }


# --- markers ----------------------------------------------------------------------------------------------------


def points_of(marker) -> np.ndarray:
    return np.array([[point.x, point.y] for point in marker.points])


def test_markers_have_the_slider_poses():
    start, predicted, observed = np.array([[0.1, 0.2, 0.3], [0.11, 0.22, 0.4], [0.112, 0.219, 0.45]])
    covariance, vertices = np.array([[4e-6, 1e-6], [1e-6, 1e-6]]), shape_outline("rect1").vertices
    drawn = prediction_markers(Sheet("world", 5), vertices, start, predicted, covariance, observed)
    markers = {marker.ns: over_the_wire(marker) for marker in drawn}
    for name, pose in {"start_outline": [0.1, 0.2], "predicted_outline": [0.11, 0.22]}.items():
        outline = points_of(markers[name])
        assert np.allclose(outline[0], outline[-1])  # closed
        assert np.allclose(outline[:-1].mean(axis=0), pose)
        assert np.allclose(np.linalg.norm(np.diff(outline, axis=0), axis=1), 0.09)
    centre = markers["observed_centre"].pose.position
    assert (centre.x, centre.y) == (0.112, 0.219)
    assert {marker.header.frame_id for marker in markers.values()} == {"world"}
    assert len({(marker.ns, marker.id) for marker in markers.values()}) == len(markers)


@given(SPREADS, SPREADS, CORRELATIONS)
def test_every_point_of_the_ellipse_has_the_same_mahalanobis_distance(sx, sy, correlation):
    covariance = np.array([[sx * sx, correlation * sx * sy], [correlation * sx * sy, sy * sy]])
    away = confidence_ellipse(np.array([0.3, -0.1]), covariance) - [0.3, -0.1]
    inverse = np.linalg.inv(covariance)
    assert np.allclose(np.einsum("ni,ij,nj->n", away, inverse, away), -2.0 * np.log(0.05), rtol=1e-3)
    assert np.allclose(away[0], away[-1])
