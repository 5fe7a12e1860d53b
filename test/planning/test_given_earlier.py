# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The prediction of the next window of a push, given its earlier windows."""

from __future__ import annotations

import numpy as np
import pytest

from push_predictor.errors import RequestError
from push_predictor.models.prediction import Prediction
from push_predictor.planning.given_earlier import LARGEST, EarlierWindows, given_earlier
from push_predictor.planning.persistence import INDEPENDENT, Persistence, root_of
from push_predictor.types import Array

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


def test_one_window_shifts_by_its_correlation() -> None:
    z = np.array([[1.0, -2.0, 0.5]])
    found, rho = given_earlier(predictions(1), earlier(z), PERSISTENCE), PERSISTENCE.correlation(np.array([STEP]))
    root = root_of(COVARIANCE[None])[0]
    np.testing.assert_allclose(found.mean[0], MEAN + root @ (rho[0] * z[0]), rtol=1e-9)
    np.testing.assert_allclose(found.covariance[0], root @ np.diag(1.0 - rho[0] ** 2) @ root.T, rtol=1e-9, atol=1e-20)
    assert found.mean[0, 0] > MEAN[0]  # what went further goes on doing so


def test_conditioning_equals_the_conditional_of_the_joint_gaussian() -> None:
    """Regression on samples of correlated windows."""
    places = STEP * np.arange(4)
    z = np.empty((200_000, 4, 3))
    for k in range(3):
        among = PERSISTENCE.correlation(np.abs(places[:, None] - places).ravel())[:, k].reshape(4, 4)
        among[np.arange(4), np.arange(4)] = 1.0
        drawn = np.random.default_rng(k).standard_normal((len(z), 4))
        z[:, :, k] = drawn @ np.linalg.cholesky(among).T
    shown = np.array([[0.5, 1.0, 0.2], [-0.4, 0.3, 1.0], [1.2, -1.0, 0.7]])
    found, root = given_earlier(predictions(1), earlier(shown), PERSISTENCE), root_of(COVARIANCE[None])[0]
    away, left = np.linalg.solve(root, found.mean[0] - MEAN), np.linalg.solve(root, root_of(found.covariance)[0])
    for k in range(3):
        weights, rest, *_ = np.linalg.lstsq(z[:, :3, k], z[:, 3, k], rcond=None)
        assert away[k] == pytest.approx(weights @ shown[:, k], abs=0.02)
        assert (left @ left.T)[k, k] == pytest.approx(rest[0] / len(z), rel=0.02)


def test_all_alternatives_are_shifted_alike_and_the_process_noise_shrinks_too() -> None:
    new = predictions(3)
    found = given_earlier(new, earlier(np.ones((2, 3))), PERSISTENCE)
    np.testing.assert_allclose(found.mean, np.tile(found.mean[0], (3, 1)))
    np.testing.assert_allclose(found.process_covariance, 0.5 * found.covariance, rtol=1e-9, atol=1e-20)


def test_outliers_count_no_more_than_large_residuals() -> None:
    large, outlier = (given_earlier(predictions(1), earlier(np.full((1, 3), z)), PERSISTENCE) for z in (LARGEST, 1e3))
    np.testing.assert_allclose(outlier.mean, large.mean, rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"observed": np.zeros((1, 3))}, "observed"),
        ({"observed": np.full((2, 3), np.nan)}, "observed"),
        ({"distance": np.array([1.0])}, "distance"),
        ({"distance": np.array([0.004, 0.0])}, "distance"),
        ({"distance": np.array([0.004, np.inf])}, "distance"),
    ],
)
def test_windows_that_do_not_match_are_refused(change: dict[str, Array], field: str) -> None:
    with pytest.raises(RequestError, match=field):
        EarlierWindows(
            **{
                "predictions": predictions(2),
                "observed": np.zeros((2, 3)),
                "distance": np.array([0.008, 0.004]),
                **change,
            }
        )
