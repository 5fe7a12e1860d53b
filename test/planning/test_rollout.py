# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Rollouts of push sequences: mechanics, symmetry, uncertainty, persistence, limits, rejected requests."""

from __future__ import annotations

import gc
import weakref
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from synthetic import RADIUS, square_pushes

from benchmarks.planning.rollout_truth import EnergyDistance
from push_predictor.errors import CovariateError, RequestError
from push_predictor.geometry.frames import rotate, to_world, wrap_angle
from push_predictor.geometry.shapes import shape_outline
from push_predictor.geometry.touch import covariance_in_world, displaced
from push_predictor.models.mechanics.fitted import ANALYTICAL_ACCURACY, analytical_mechanics
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors import MechanicsPredictor
from push_predictor.models.push_model import Provenance, PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.planning.given_earlier import LARGEST, EarlierWindows, given_earlier
from push_predictor.planning.particles import Deviations, windows_of
from push_predictor.planning.persistence import INDEPENDENT, Persistence, fit_persistence, persistence_of, root_of
from push_predictor.planning.rollout import MOST_PARTICLES, is_covariance, pose_moments, rollout
from push_predictor.planning.straight_drive import start_drive
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

SD = np.array([2e-4, 3e-4, 6e-3])
CERTAIN, NOISY = np.zeros((3, 3)), np.diag(SD**2)
CORRELATED = np.array([[1.0, 0.3, -0.2], [0.3, 1.0, 0.8], [-0.2, 0.8, 1.0]])
AT_REST = np.zeros(3)
PUSH = [0.02, 0.1, 0.2, 1.0]  # five windows


def model_with(covariance: Array, shape: str = "rect1") -> PushModel:
    """The analytical model of a shape, every window of 0.2 s with one covariance (3, 3)."""
    rig = Rig(shape, shape_outline(shape), RADIUS, "abs", 0.837)
    predictor = MechanicsPredictor(analytical_mechanics(rig.outline, RADIUS), covariance)
    return PushModel("made", "analytical", rig, predictor, square_pushes(40)[0], Provenance((), 8, 0, "0"))


def heading_of(contact: float, angle: float, model: PushModel) -> float:
    """Of a push on a slider at rest in the world's axes, rad."""
    inward = model.rig.outline.inward_normal(np.array([contact]))[0]
    return float(np.arctan2(inward[1], inward[0]) + angle)


def after_one_push(model: PushModel, step: list[float]) -> Array:
    """Where the analytical model has the slider (3,) after one push from rest, integrated at once."""
    velocity, contact, angle, duration = step
    heading = np.array([heading_of(contact, angle, model)])
    moved = model.predictor.mechanics.displacement(np.array([[velocity, contact, angle]]), np.array([duration]))
    return displaced(AT_REST[None], heading, moved)[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    "shape, contact, angle, duration",
    [("rect1", 0.1, 0.1, 3.0), ("rect1", 0.2, 0.5, 3.0), ("rect1", 0.02, 0.0, 1.5), ("ellip2", 0.2, 0.5, 3.0)],
)
def test_rollout_without_noise_equals_the_integrated_push(shape, contact, angle, duration) -> None:
    model, step = model_with(CERTAIN, shape), [0.02, contact, angle, duration]
    rolled = rollout(model, AT_REST, CERTAIN, [step], particles=2, persistence=INDEPENDENT)
    # Each window is integrated to ANALYTICAL_ACCURACY of its displacement, which a tenth of it bounds here.
    np.testing.assert_allclose(rolled.mean[0], after_one_push(model, step), rtol=0.1 * ANALYTICAL_ACCURACY, atol=2e-7)
    np.testing.assert_allclose(rolled.covariance[0], 0.0, atol=1e-20)


def test_each_step_starts_at_the_current_pose_of_the_slider() -> None:
    model, steps = model_with(CERTAIN), [[0.02, 0.1, 0.2, 0.6], [0.02, 0.6, -0.3, 0.4]]
    rolled = rollout(model, AT_REST, CERTAIN, steps, particles=1, persistence=INDEPENDENT)
    first, second = (after_one_push(model, step) for step in steps)
    np.testing.assert_allclose(rolled.mean[0], first, atol=1e-8)
    expected = [*to_world(second[None, :2], first[None])[0], first[2] + second[2]]
    np.testing.assert_allclose(rolled.mean[1], expected, atol=1e-8)


def test_rollout_of_one_window_equals_the_prediction() -> None:
    model, particles = model_with(NOISY), 40_000
    model = replace(model, predictor=replace(model.predictor, covariance=np.diag(SD) @ CORRELATED @ np.diag(SD)))
    rolled = rollout(model, AT_REST, CERTAIN, [[0.02, 0.1, 0.2, 0.2]], particles)
    heading = heading_of(0.1, 0.2, model)
    expected = covariance_in_world(model.predictor.covariance[None], np.array([heading]))[0]
    error = np.sqrt(np.diagonal(expected) / particles)
    off = rolled.mean[0] - after_one_push(model, [0.02, 0.1, 0.2, 0.2])
    assert np.all(np.abs(off) < 4.0 * error)
    scale = np.sqrt(np.diagonal(expected))
    np.testing.assert_allclose((rolled.covariance[0] - expected) / np.outer(scale, scale), 0.0, atol=0.03)


@pytest.mark.parametrize(("correlation", "accuracy"), [
    (np.eye(3), 1e-15),
    (CORRELATED, 1e-13),
    ([[1.0, -0.9, 0.0], [-0.9, 1.0, 0.3], [0.0, 0.3, 1.0]], 1e-13),
    ([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 1e-7),  # singular
    ([[1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]], 1e-7),
    (np.diag([1.0, 0.0, 1.0]), 1e-15),  # an output without noise
    (CERTAIN, 0.0),
])  # fmt: skip
def test_covariance_root_is_that_of_an_eigendecomposition(correlation: Array, accuracy: float) -> None:
    correlation = np.asarray(correlation)
    values, vectors = np.linalg.eigh(correlation)
    expected = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    found = root_of(np.array([SD[:, None] * correlation * SD, correlation]))
    np.testing.assert_allclose(found, [SD[:, None] * expected, expected], rtol=0.0, atol=accuracy)
    np.testing.assert_allclose(found[0] / SD[:, None], expected, rtol=0.0, atol=accuracy)


def test_rollout_is_equivariant_under_translation_and_rotation() -> None:
    model, where = model_with(NOISY), np.array([0.3, -0.1, 2.0])
    here, there = (rollout(model, pose, CERTAIN, [PUSH, PUSH], 50) for pose in (AT_REST, where))
    np.testing.assert_allclose(there.samples[:, :2], rotate(here.samples[:, :2], where[2]) + where[:2], atol=1e-12)
    np.testing.assert_allclose(there.mean[:, 2], here.mean[:, 2] + where[2], atol=1e-12)
    np.testing.assert_allclose(there.covariance, covariance_in_world(here.covariance, np.full(2, 2.0)), atol=1e-15)


def test_uncertainty_of_the_start_is_propagated() -> None:
    """A slider whose heading is off goes off sideways by the way it is pushed; without noise that is all."""
    model, sd = model_with(CERTAIN), np.array([1e-3, 2e-3, 0.02])
    rolled = rollout(model, AT_REST, np.diag(sd**2), [PUSH], 6000)
    moved = after_one_push(model, PUSH)
    lever = np.eye(3)
    lever[:2, 2] = [-moved[1], moved[0]]
    expected = lever @ np.diag(sd**2) @ lever.T
    scale = np.sqrt(np.diagonal(expected))
    np.testing.assert_allclose((rolled.covariance[0] - expected) / np.outer(scale, scale), 0.0, atol=0.05)


def test_slider_touches_the_tip_at_the_end() -> None:
    """Deviations along the normal do not add up: a slider that went too far is touched later in the next window."""
    along = np.diag([2e-4, 0.0, 0.0]) ** 2
    model, straight = model_with(along), [0.02, 0.125, 0.0, 4.0]
    rolled = rollout(model, AT_REST, CERTAIN, [straight], 1000, persistence=INDEPENDENT)
    ahead = rotate(rolled.samples[:, :2], np.array(-heading_of(0.125, 0.0, model)))[:, 0]
    assert ahead.mean() == pytest.approx(0.08, abs=2e-5)
    assert ahead.std() == pytest.approx(2e-4, rel=0.1)


@pytest.mark.parametrize("edge", [0, 1, 2, 3])
@pytest.mark.parametrize("end", [0.0, 1.0])
def test_contact_at_a_corner_belongs_to_the_edge_it_slid_along(edge: int, end: float) -> None:
    """A tip that is nearly round the corner faces the other edge more squarely."""
    outline, towards = shape_outline("rect1"), -1.0 if end else 1.0
    contact = outline.contact_on_edge(edge, end + 0.002 * (0.5 - end))
    inputs, slider = np.array([[0.02, float(contact), 1.2 * towards]]), np.zeros((1, 3))
    drive, contact = start_drive(outline, RADIUS, slider, inputs)
    later = drive.contact_at(slider, contact, 0.2, 0.2)
    assert later.touch.inputs[0, 1] == pytest.approx(float(outline.contact_on_edge(edge, end)))
    assert later.touch.inputs[0, 2] == pytest.approx(1.2 * towards)


def test_slider_does_not_move_after_the_tip_has_passed() -> None:
    model = model_with(CERTAIN)
    off, later = ([0.02, 0.24, -1.3, duration] for duration in (3.0, 5.0))
    poses = [rollout(model, AT_REST, CERTAIN, [step], 1) for step in (off, later)]
    assert [rolled.in_contact[0] for rolled in poses] == [0.0, 0.0]
    np.testing.assert_array_equal(poses[0].mean, poses[1].mean)
    assert rollout(model, AT_REST, CERTAIN, [PUSH], 1).in_contact[0] == 1.0


def test_mean_heading_is_circular() -> None:
    heading = np.pi + 0.1 * np.random.default_rng(0).standard_normal(2000)
    mean, covariance = pose_moments(np.column_stack([np.zeros((2000, 2)), wrap_angle(heading)]))
    assert abs(mean[2]) == pytest.approx(np.pi, abs=0.01)
    assert covariance[2, 2] == pytest.approx(0.01, rel=0.1)
    rolled = rollout(model_with(NOISY), np.array([0.0, 0.0, np.pi]), CERTAIN, [PUSH], 500)
    assert np.all(np.abs(rolled.samples[:, 2]) <= np.pi) and rolled.covariance[0, 2, 2] < 0.01


def test_seed_determines_the_samples() -> None:
    model = model_with(NOISY)
    one, again, other = (rollout(model, AT_REST, NOISY, [PUSH], 20, seed).samples for seed in (5, 5, 6))
    np.testing.assert_array_equal(one, again)
    assert not np.any(one == other)


def test_rollout_without_steps_returns_the_start_samples() -> None:
    rolled = rollout(model_with(NOISY), np.array([1.0, 2.0, 0.5]), NOISY, np.empty((0, 4)), 5000)
    assert rolled.mean.shape == (0, 3) and rolled.covariance.shape == (0, 3, 3)
    np.testing.assert_allclose(rolled.samples.std(axis=0), SD, rtol=0.05)
    axis = np.array([1e-3, -2e-3, 1e-2])
    singular = rollout(model_with(CERTAIN), AT_REST, np.outer(axis, axis), np.empty((0, 4)), 50).samples
    np.testing.assert_allclose(np.cross(singular, axis), 0.0, atol=1e-9)


# --- persistence ----------------------------------------------------------------------------------------------------


def test_deviates_have_the_given_correlation_over_distance() -> None:
    given = Persistence(np.array([0.3, 0.0, 0.1]), np.array([0.5, 0.9, 0.0]), np.array([4e-3, 2e-3, 1e-3]))
    deviations = Deviations(given, np.full(40_000, 3e-3), np.random.default_rng(0))
    drawn = np.array([deviations.next() for _ in range(4)])
    np.testing.assert_allclose(np.mean(drawn**2, axis=1), 1.0, atol=0.05)
    for lag in (1, 3):
        expected = given.correlation(np.array([3e-3 * lag]))[0]
        np.testing.assert_allclose(np.mean(drawn[0] * drawn[lag], axis=0), expected, atol=0.03)


def pushes_with(persistence: Persistence, pushes: int, windows: int) -> tuple[Array, PushTable]:
    """Residuals (pushes * windows, 3) of that persistence, and the table of the windows; 4 mm each."""
    deviations = Deviations(persistence, np.full(pushes, 4e-3), np.random.default_rng(1))
    residuals = np.array([deviations.next() for _ in range(windows)]).transpose(1, 0, 2).reshape(-1, 3)
    n = pushes * windows
    push_id = np.repeat([f"p{k}" for k in range(pushes)], windows)
    inputs = np.column_stack([np.full(n, 0.02), np.full(n, 0.1), np.zeros(n)])
    return residuals, PushTable(inputs, np.full(n, 0.2), np.zeros((n, 3)), push_id)


@pytest.mark.parametrize(
    "given", [Persistence(np.array([0.3, 0.0, 0.5]), np.array([0.4, 0.8, 0.0]), np.full(3, 8e-3)), INDEPENDENT]
)
def test_fit_recovers_persistence_from_residuals(given: Persistence) -> None:
    found, way = fit_persistence(*pushes_with(given, 1500, 8)), np.array([4e-3, 8e-3, 16e-3, 28e-3])
    np.testing.assert_allclose(found.correlation(way), given.correlation(way), atol=0.05)


def test_fit_shrinks_with_few_pushes_and_is_zero_for_single_windows() -> None:
    given = Persistence(np.full(3, 0.95), np.zeros(3), np.ones(3))
    many, few = (fit_persistence(*pushes_with(given, pushes, 10)) for pushes in (1000, 5))
    assert np.all(many.correlation(np.array([4e-3])) > 0.85) and np.all(few.correlation(np.array([4e-3])) <= 0.5)
    np.testing.assert_array_equal(fit_persistence(*pushes_with(given, 30, 1)).correlation(np.array([4e-3])), 0.0)


# --- windows and refusals -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def learnt() -> PushModel:
    """A GP of 40 windows of 0.2 s."""
    return train_model(*square_pushes(40), "gp", name="learnt", options=TrainingOptions(mean="zero"))


@pytest.mark.parametrize(
    "duration, count", [(0.2, 1), (0.18, 1), (0.22, 1), (0.4, 2), (0.9, 5), (1.0, 5), (0.85, 4), (3.1, 16)]
)
def test_push_is_divided_into_windows_of_the_training_duration(learnt, duration, count) -> None:
    windows = windows_of(learnt, duration)
    assert windows.count == count and windows.duration * count == pytest.approx(duration)
    assert windows.asked == 0.2 and windows.scale == pytest.approx(windows.duration / 0.2)
    assert 0.9 - 1e-9 <= windows.scale <= 1.1 + 1e-9


def test_displacement_scales_with_duration_within_the_tolerance(learnt) -> None:
    short, long = (rollout(learnt, AT_REST, CERTAIN, [[0.02, 0.1, 0.1, duration]], 200) for duration in (0.2, 0.22))
    np.testing.assert_allclose(long.samples, 1.1 * short.samples, rtol=1e-9)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"steps": [PUSH, PUSH, [0.02, 0.1, 1.6, 1.0]]}, r"steps\[2\]\.angle: 1\.6 is not accepted, give an angle"),
        (
            {"steps": [[0.02, 0.1, 0.0, 0.5]]},
            r"steps\[0\]\.duration: 0\.5 .*0\.18 to 0\.22 s, or a multiple of such a duration",
        ),
        ({"steps": [[0.02, 0.1, 0.0, np.inf]]}, r"steps\[0\]\.duration: inf"),
        ({"steps": [[0.02, 0.1, 0.0, 1e300]]}, r"steps\[0\]\.duration: 1e\+300 .*at most 2000 s, 10000 windows"),
        ({"steps": [[0.02, 0.1, 0.0, 400.0]], "particles": 100}, r"steps: '2000 windows'.*at most 1000 windows"),
        ({"particles": 0}, r"particles: 0 .*1 to 100000"),
        ({"particles": MOST_PARTICLES + 1}, r"particles: 100001"),
        ({"slider_mean": [0.0, np.nan, 0.0]}, r"slider_mean: \[0\.0, nan, 0\.0\]"),
        ({"slider_covariance": np.diag([1.0, np.nan, 1.0])}, r"slider_covariance: .*symmetric"),
        ({"slider_covariance": np.diag([1.0, -1e-3, 1.0])}, r"slider_covariance: .*without negative"),
        ({"slider_covariance": [[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]}, r"slider_covariance"),
        ({"slider_covariance": np.eye(2)}, r"slider_covariance"),
        ({"slider_covariance": np.diag([-5e-9, 1e-9, 10.0])}, r"slider_covariance"),
        ({"slider_covariance": np.diag([1e300, 1e-6, 1e-6])}, r"slider_covariance"),
        ({"slider_mean": [1e300, 0.0, 0.0]}, r"slider_mean: \[1e\+300"),
    ],
)
def test_rejects_invalid_steps_by_name(learnt, change, message) -> None:
    asked = {"slider_mean": AT_REST, "slider_covariance": CERTAIN, "steps": [PUSH], "particles": 10, **change}
    with pytest.raises(RequestError, match=message):
        rollout(learnt, **asked)


def test_accepts_a_covariance_in_single_precision() -> None:
    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]], dtype=np.float32)
    near_isotropic = np.diag(np.array([1.0e-6, 1.1e-6, 1e-4], dtype=np.float32))
    matrix = (turn @ near_isotropic @ turn.T).astype(np.float64)
    matrix[0, 1] *= 1.0 + 1e-7
    assert is_covariance(matrix)
    rollout(model_with(CERTAIN), AT_REST, matrix, np.empty((0, 4)), 5)


def test_persistence_cache_does_not_keep_a_model_alive() -> None:
    model = model_with(NOISY)
    persistence_of(model)
    there = weakref.ref(model)
    del model
    gc.collect()
    assert there() is None


def test_cancelled_rollout_stops_between_windows() -> None:
    asked = []

    def check_cancelled() -> None:
        asked.append(len(asked))
        if len(asked) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rollout(model_with(NOISY), AT_REST, CERTAIN, [[0.02, 0.1, 0.0, 3.0]], 5, check_cancelled=check_cancelled)
    assert len(asked) == 3


@dataclass(eq=False)
class Attentive:
    """A predictor that needs covariates, and remembers what it was given."""

    learnt, effects, covariates, tails, own_limits = False, (), (), None, None
    needs: tuple[str, ...]
    seen: list[Push] = field(default_factory=list)

    def moments(self, push: Push) -> tuple[Array, Array, Array]:
        """A millimetre ahead and a turn of 0.1 rad for every push."""
        self.seen.append(push)
        covariance = np.zeros((len(push.inputs), 3, 3))
        return np.tile([1e-3, 0.0, 0.1], (len(push.inputs), 1)), covariance, covariance


def test_pose_covariates_are_those_of_each_sample() -> None:
    predictor = Attentive(("slider_x", "slider_y", "slider_heading", "push_heading"))
    model = replace(model_with(CERTAIN), predictor=predictor)  # type: ignore[arg-type]  # a predictor of the test's own
    start = np.array([0.1, 0.2, 3.1])
    rolled = rollout(model, start, CERTAIN, [[0.02, 0.125, 0.3, 0.2]] * 2, 3, persistence=INDEPENDENT)
    first, second = (push.covariates for push in predictor.seen)
    np.testing.assert_allclose([first[name] for name in predictor.needs[:3]], np.tile(start[:, None], 3))
    np.testing.assert_allclose(first["push_heading"], wrap_angle(np.array(3.1 + heading_of(0.125, 0.3, model))))
    np.testing.assert_allclose(second["slider_x"], rolled.mean[0, 0])
    np.testing.assert_allclose(second["slider_heading"], 3.2 - 2.0 * np.pi)


def test_given_covariates_apply_to_all_windows_of_their_step() -> None:
    predictor = Attentive(("slider_x", "elapsed_time"))
    model = replace(model_with(CERTAIN), predictor=predictor)  # type: ignore[arg-type]  # a predictor of the test's own
    steps, given = [[0.02, 0.125, 0.0, 0.4], [0.02, 0.125, 0.0, 0.2]], {"elapsed_time": np.array([7.0, 9.0])}
    start = np.array([0.3, 0.0, 0.0])
    rollout(model, start, CERTAIN, steps, 2, persistence=INDEPENDENT, covariates=given)
    assert [push.covariates["elapsed_time"].tolist() for push in predictor.seen] == [[7.0, 7.0], [7.0, 7.0], [9.0, 9.0]]
    assert predictor.seen[0].covariates["slider_x"].tolist() == [0.3, 0.3]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, r"^steps\[0\]\.covariate elapsed_time: 'missing' is not accepted, give a finite number"),
        ({"elapsed_time": [1.0, np.nan]}, r"^steps\[1\]\.covariate elapsed_time: nan is not accepted"),
        (
            {"elapsed_time": [1.0, 1.0], "slider_heading": [0.1, 0.1]},
            r"^covariate_names: 'slider_heading' is not accepted",
        ),
    ],
)
def test_rejects_covariates_that_are_missing_not_finite_or_known_from_the_pose(
    given: dict[str, list[float]], message: str
) -> None:
    predictor = Attentive(("slider_heading", "elapsed_time"))
    model = replace(model_with(CERTAIN), predictor=predictor)  # type: ignore[arg-type]  # a predictor of the test's own
    covariates = {name: np.array(values) for name, values in given.items()}
    with pytest.raises(CovariateError, match=message):
        rollout(model, AT_REST, CERTAIN, [PUSH, PUSH], 3, covariates=covariates)


# --- what the benchmark measures by ---------------------------------------------------------------------------------


def test_energy_distance_is_zero_for_equal_distributions_and_grows_with_their_distance() -> None:
    rng = np.random.default_rng(0)
    draws = [rng.standard_normal((400, 3)) for _ in range(41)]
    same = np.array([EnergyDistance(one, draws[0], 0.5).value() for one in draws[1:]])
    shifted = [EnergyDistance(draws[1] + [by, 0.0, 0.0], draws[0], 0.5).value() for by in (0.3, 3.0, 30.0)]
    assert abs(same.mean()) < 0.01 and same.min() < 0.0 < same.max()
    assert same.max() < shifted[0] < shifted[1] < shifted[2] and shifted[2] == pytest.approx(60.0, rel=0.1)


def test_bootstrap_does_not_compare_a_repetition_with_itself() -> None:
    rng = np.random.default_rng(1)
    samples, truth = rng.standard_normal((50, 3)), rng.standard_normal((30, 3))
    distance, weight = EnergyDistance(samples, truth, 1.0), np.tile([2.0, 0.0], 15)
    assert distance.value(weight) == pytest.approx(EnergyDistance(samples, truth[::2], 1.0).value())


# --- the next window of a push, given its earlier windows ---


PERSISTENCE = Persistence(np.array([0.3, 0.1, 0.0]), np.array([0.4, 0.5, 0.0]), np.array([4e-3, 8e-3, 1e-3]))
STEP = 4e-3  # m
COVARIANCE = np.array([[4.0, 1.0, 0.0], [1.0, 1.0, 0.2], [0.0, 0.2, 25.0]]) * 1e-8
MEAN = np.array([3e-3, 1e-3, 0.02])


def predictions(count: int) -> Prediction:
    covariance = np.tile(COVARIANCE, (count, 1, 1))
    return Prediction(np.tile(MEAN, (count, 1)), covariance, 0.5 * covariance, np.ones(count, dtype=np.bool_))


def earlier(whitened: Array) -> EarlierWindows:
    """Contiguous windows with these whitened residuals (k, 3), the last one just before the predicted one."""
    k = len(whitened)
    observed = MEAN + whitened @ root_of(COVARIANCE[None])[0].T
    return EarlierWindows(predictions(k), observed, STEP * np.arange(k, 0, -1))


def test_without_earlier_windows_or_persistence_nothing_changes() -> None:
    new = predictions(2)
    assert given_earlier(new, earlier(np.zeros((0, 3))), PERSISTENCE) is new
    found = given_earlier(new, earlier(np.ones((3, 3))), INDEPENDENT)
    np.testing.assert_allclose(found.mean, new.mean)
    np.testing.assert_allclose(found.covariance, new.covariance, atol=1e-20)


@pytest.mark.parametrize("count", [1, 3])
def test_conditioning_equals_the_conditional_of_the_joint_gaussian(count: int) -> None:
    """What went further goes on doing so."""
    shown = np.array([[1.2, -1.0, 0.7], [-0.4, 0.3, 1.0], [0.5, 1.0, 0.2]])[:count]
    found, root = given_earlier(predictions(1), earlier(shown), PERSISTENCE), root_of(COVARIANCE[None])[0]
    places, shift, left = STEP * np.arange(count + 1), np.zeros(3), np.zeros(3)
    for k in range(3):
        among = PERSISTENCE.correlation(np.abs(places[:, None] - places).ravel())[:, k].reshape(count + 1, count + 1)
        np.fill_diagonal(among, 1.0)
        weights = np.linalg.solve(among[:-1, :-1], among[:-1, -1])
        shift[k], left[k] = weights @ shown[:, k], 1.0 - weights @ among[:-1, -1]
    assert shift[0] > 0.1
    np.testing.assert_allclose(found.mean[0], MEAN + root @ shift, rtol=1e-9)
    np.testing.assert_allclose(found.covariance[0], root @ np.diag(left) @ root.T, rtol=1e-9, atol=1e-20)


def test_all_alternatives_are_shifted_alike_and_the_process_noise_shrinks_too() -> None:
    new = predictions(3)
    found = given_earlier(new, earlier(np.ones((2, 3))), PERSISTENCE)
    np.testing.assert_allclose(found.mean, np.tile(found.mean[0], (3, 1)))
    np.testing.assert_allclose(found.process_covariance, 0.5 * found.covariance, rtol=1e-9, atol=1e-20)


def test_outliers_count_no_more_than_large_residuals() -> None:
    large, outlier = (given_earlier(predictions(1), earlier(np.full((1, 3), z)), PERSISTENCE) for z in (LARGEST, 1e3))
    np.testing.assert_allclose(outlier.mean, large.mean, rtol=1e-9)


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("observed", [np.zeros((1, 3)), np.full((2, 3), np.nan)]),
        ("distance", [np.array([1.0]), np.array([0.004, 0.0]), np.array([0.004, np.inf])]),
    ],
)
def test_windows_that_do_not_match_are_refused(field: str, values: list[Array]) -> None:
    sound = {"predictions": predictions(2), "observed": np.zeros((2, 3)), "distance": np.array([0.008, 0.004])}
    for value in values:
        with pytest.raises(RequestError, match=field):
            EarlierWindows(**{**sound, field: value})
