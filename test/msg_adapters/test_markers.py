# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The markers of a window show the pusher, and the outcome relative to the prediction, at two scales."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2, f, norm, t
from visualization_msgs.msg import Marker, MarkerArray

from examples.marker_canvas import draw_array
from msg_adapters.markers import (
    CHI2_95_OF_TWO,
    MAGNIFICATION,
    NORMAL_95,
    Sheet,
    error_in_sd,
    magnified_markers,
    window_markers,
)
from push_predictor.geometry.frames import rotate, to_body
from push_predictor.geometry.shapes import shape_outline
from push_predictor.geometry.touch import displaced
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors.tails import STEPS, Tails
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.push_window import PushWindow

SD = np.array([2e-4, 3e-4, 0.01])
CORRELATION = np.array([[1.0, 0.5, -0.3], [0.5, 1.0, 0.2], [-0.3, 0.2, 1.0]])
COVARIANCE = np.outer(SD, SD) * CORRELATION
MEAN = np.array([3e-3, 5e-4, 0.03])
ERRORS = st.tuples(*[st.floats(-4.0, 4.0)] * 3)


def rig(shape: str = "rect1") -> Rig:
    return Rig(shape, shape_outline(shape), 0.00475, "abs", 0.8)


def window(outcome: np.ndarray, start=(0.1, -0.2, 0.3), contact: float = 0.1, angle: float = 0.4, shape="rect1"):
    """A window with a consistent push heading."""
    pose = np.array(start)
    normal = rotate(shape_outline(shape).inward_normal(np.array([contact])), pose[2:])[0]
    heading = float(np.arctan2(normal[1], normal[0]) + angle)
    end = displaced(pose[None], np.array([heading]), outcome[None])[0]
    return PushWindow(
        "push-1.5", 3, 10**9, 12 * 10**8, 0.02, contact, angle, 0.2, outcome, pose, end, heading, covariates={}
    )


def predicted(mean: np.ndarray = MEAN) -> Prediction:
    return Prediction(mean[None], COVARIANCE[None], 0.5 * COVARIANCE[None], np.array([True]))


def markers(at: PushWindow, shape: str = "rect1") -> dict[str, Marker]:
    array = window_markers(rig(shape), at, predicted(), "world")
    named = {marker.ns: marker for marker in array.markers}
    assert len(named) == len(array.markers) and {marker.id for marker in array.markers} == {0}
    return named


def half_of_dial(shown: dict[str, Marker], zero: float) -> float:
    """Half the angle of the heading's interval, enlarged."""
    band = points(shown["magnified_heading"]) - points(shown["predicted_ellipse"])[:-1].mean(axis=0)
    return float(np.max((np.arctan2(band[:, 1], band[:, 0]) - zero + np.pi) % (2 * np.pi) - np.pi))


def points(marker: Marker) -> np.ndarray:
    return np.array([[point.x, point.y] for point in marker.points])


def centre(marker: Marker) -> np.ndarray:
    return np.array([marker.pose.position.x, marker.pose.position.y])


@pytest.mark.parametrize("shape", ["rect1", "hex", "ellip2"])
@pytest.mark.parametrize("contact", [0.03, 0.3, 0.77])
def test_the_pusher_touches_the_slider_at_the_contact_and_the_arrow_points_into_its_back(shape, contact):
    at = window(MEAN, contact=contact, shape=shape)
    shown = markers(at, shape)
    disc, (tail, head) = shown["pusher"], points(shown["push"])
    found = shape_outline(shape).project(to_body(centre(disc)[None], at.slider_start))
    assert found.distance[0] == pytest.approx(0.00475, rel=1e-6)
    assert found.contact[0] == pytest.approx(contact, abs=1e-6)
    assert disc.type == Marker.CYLINDER and disc.scale.x == disc.scale.y == 2 * 0.00475
    along = np.array([np.cos(at.push_heading), np.sin(at.push_heading)])
    assert np.allclose((head - tail) / np.linalg.norm(head - tail), along)
    assert np.allclose(head + 0.00475 * along, centre(disc))


def test_an_outcome_equal_to_the_prediction_is_centred_in_all_markers():
    shown = markers(window(MEAN))
    middle = points(shown["predicted_ellipse"])[:-1].mean(axis=0)
    assert np.allclose(centre(shown["magnified_observed"]), middle, atol=1e-12)
    assert np.allclose(centre(shown["observed_centre"]), middle, atol=1e-12)
    band, stroke = (points(shown[f"magnified_{name}"]) - middle for name in ("heading", "observed_heading"))
    at, ends = np.arctan2(*stroke.mean(axis=0)[::-1]), np.arctan2(band[:, 1], band[:, 0])
    turn = (ends - at + np.pi) % (2 * np.pi) - np.pi
    assert turn.min() == pytest.approx(-turn.max())
    assert turn.max() == pytest.approx(MAGNIFICATION * NORMAL_95 * SD[2])
    assert at == pytest.approx(window(MEAN).push_heading)  # on the far side of the pusher
    assert "error 0.0 sd" in shown["label"].text


@given(ERRORS)
def test_true_and_enlarged_markers_agree_on_inside_or_outside(error):
    """Inside is as the covariance defines it, for the centre and for the heading."""
    away = np.linalg.cholesky(COVARIANCE) @ np.array(error)
    shown = markers(window(MEAN + away))
    inside = away[:2] @ np.linalg.solve(COVARIANCE[:2, :2], away[:2]) / CHI2_95_OF_TWO
    for ellipse, dot in (("predicted_ellipse", "observed_centre"), ("magnified_ellipse", "magnified_observed")):
        edge = points(shown[ellipse])[:-1]
        middle = edge.mean(axis=0)
        shape = np.linalg.inv(2.0 * (edge - middle).T @ (edge - middle) / len(edge))  # unit circle's image
        assert (centre(shown[dot]) - middle) @ shape @ (centre(shown[dot]) - middle) == pytest.approx(
            inside, rel=1e-6, abs=1e-9
        )
    middle = points(shown["predicted_ellipse"])[:-1].mean(axis=0)
    stroke, zero = points(shown["magnified_observed_heading"]) - middle, window(MEAN).push_heading
    half = half_of_dial(shown, zero)
    turned = (np.arctan2(stroke[0, 1], stroke[0, 0]) - zero + np.pi) % (2 * np.pi) - np.pi
    assert turned / half == pytest.approx(away[2] / (NORMAL_95 * SD[2]), rel=1e-6, abs=1e-9)


@given(ERRORS)
def test_the_label_shows_the_distance_and_is_red_beyond_the_limit(error):
    away = np.linalg.cholesky(COVARIANCE) @ np.array(error)
    distance = float(np.linalg.norm(error))
    assert error_in_sd(window(MEAN + away), predicted()) == pytest.approx(distance, rel=1e-6, abs=1e-9)
    label = markers(window(MEAN + away))["label"]
    assert f"error {distance:.1f} sd" in label.text or abs(10 * distance % 1.0 - 0.5) < 1e-6
    limit = 2.795483482915108  # the root of the 95 % quantile of chi-squared with three degrees of freedom
    if abs(distance - limit) > 1e-6:
        assert (label.color.g < 0.5) == (distance > limit)
    assert label.text.startswith("push-1.5, window 3\n20 mm/s, ")


def test_tails_widen_the_ellipse_and_the_limit_of_the_label():
    tails = Tails(np.ones(3), np.full(3, 4.0), 0.8, 3.0, 20, np.zeros((STEPS, 3)))
    away = np.linalg.cholesky(COVARIANCE) @ np.array([0.0, 0.0, 3.0])
    narrow, wide = (
        {m.ns: m for m in window_markers(rig(), window(MEAN + away), replace(predicted(), tails=each), "world").markers}
        for each in (None, tails)
    )
    across = [np.ptp(points(shown["predicted_ellipse"]), axis=0) for shown in (narrow, wide)]
    expected = 0.8 * np.sqrt(2.0 * f.ppf(0.95, 2, 3.0)) / np.sqrt(chi2.ppf(0.95, 2))
    assert across[1] / across[0] == pytest.approx(np.full(2, expected))
    halves = [half_of_dial(shown, window(MEAN + away).push_heading) for shown in (narrow, wide)]
    assert halves[1] / halves[0] == pytest.approx(np.sqrt(0.5) * t.ppf(0.975, 4.0) / norm.ppf(0.975), rel=1e-6)
    assert narrow["label"].color.g < 0.5 < wide["label"].color.g and 0.8 * np.sqrt(3.0 * f.ppf(0.95, 3, 3.0)) > 3.0


def test_rotating_the_world_rotates_everything_but_the_label():
    turn, shift = 0.8, np.array([0.03, -0.02])
    at = window(MEAN + SD)
    moved = np.append(rotate(at.slider_start[:2], np.array(turn)) + shift, at.slider_start[2] + turn)
    before, after = markers(at), markers(window(MEAN + SD, start=tuple(moved)))
    for name in before.keys() - {"label", "predicted_ellipse", "magnified_ellipse"}:
        then, now = before[name], after[name]
        if then.points:
            expected = rotate(points(then), np.array(turn)) + shift
            assert np.allclose(points(now), expected, atol=1e-12), name
        else:
            assert np.allclose(centre(now), rotate(centre(then), np.array(turn)) + shift, atol=1e-12), name


def test_an_unknown_heading_fills_the_dial_once():
    wide = np.diag([1e-8, 1e-8, 9.0])
    array = magnified_markers(Sheet("world", 0), np.zeros(3), wide, np.array([0.0, 0.0, 6.2]), 0.06, 0.0)
    band = next(points(marker) for marker in array if marker.ns == "magnified_heading")
    swept = np.unwrap(np.arctan2(band[:49, 1], band[:49, 0]))
    assert swept[-1] - swept[0] == pytest.approx(2 * np.pi)


def axes():
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # not at the top: every worker imports every test
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.0, 4.0), dpi=100)
    FigureCanvasAgg(figure)
    made = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    made.set(xlim=(-0.1, 0.1), ylim=(-0.1, 0.1))
    return made


def test_the_canvas_draws_sizes_positions_and_colours_of_the_message():
    made = axes()
    at = window(MEAN, start=(0.0, 0.0, 0.3))
    array = window_markers(rig(), at, predicted(), "world")
    draw_array(made, array)
    named = {marker.ns: marker for marker in array.markers}
    disc = next(patch for patch in made.patches if type(patch).__name__ == "Ellipse")
    assert (disc.width, disc.height) == (2 * 0.00475, 2 * 0.00475)
    assert np.allclose(disc.center, centre(named["pusher"]))
    arrow = next(patch for patch in made.patches if type(patch).__name__ == "Polygon")
    tail, head = points(named["push"])
    corners = arrow.get_xy()
    assert np.min(np.linalg.norm(corners - head, axis=1)) < 1e-12
    assert np.ptp((corners - tail) @ ((head - tail) / np.linalg.norm(head - tail))) == pytest.approx(0.02)
    outline = next(line for line in made.lines if len(line.get_xdata()) == 5)
    assert np.allclose(np.stack(outline.get_data(), axis=1), points(named["start_outline"]))
    assert outline.get_linewidth() == pytest.approx(0.0008 * 4.0 * 72.0 / 0.2, rel=1e-6)  # metres in points
    assert outline.get_color() == pytest.approx((0.65, 0.65, 0.65, 0.8), abs=1e-6)
    assert [text.get_text() for text in made.texts] == [named["label"].text]


def test_the_canvas_applies_a_markers_pose_and_rejects_unknown_markers():
    made, marker = axes(), Marker(type=Marker.TRIANGLE_LIST, action=Marker.ADD)
    marker.pose.position.x, marker.pose.orientation.z, marker.pose.orientation.w = 0.05, 1.0, 0.0  # half a turn
    marker.scale.x, marker.scale.y = 2.0, 1.0
    marker.points = [type(marker.pose.position)(x=x, y=y) for x, y in ((0.0, 0.0), (0.01, 0.0), (0.0, 0.01))]
    draw_array(made, MarkerArray(markers=[marker]))
    (path,) = made.collections[0].get_paths()
    assert np.allclose(path.vertices[:3], [[0.05, 0.0], [0.03, 0.0], [0.05, -0.01]])
    with pytest.raises(ValueError, match="cannot be drawn"):
        draw_array(made, MarkerArray(markers=[Marker(type=Marker.MESH_RESOURCE)]))
    with pytest.raises(ValueError, match="cannot be drawn"):
        draw_array(made, MarkerArray(markers=[Marker(action=Marker.DELETEALL)]))
