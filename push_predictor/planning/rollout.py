# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Roll out a sequence of pushes on samples of the slider's pose.

Every push is relative to the slider's pose at its start: the robot observes the slider before each push and places the
pusher at the commanded contact. Within a push there is no feedback, and the tip moves in a straight line. A sample that
has rotated further is touched elsewhere, so steps with one mode each may lead to an outcome with several.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from push_predictor.blas_threads import one_blas_thread
from push_predictor.errors import CovariateError, RequestError, TooLargeError
from push_predictor.geometry.frames import wrap_angle
from push_predictor.models.push_model import PushModel
from push_predictor.models.request import PushRequest, check_request
from push_predictor.models.tabulated.tabulated_model import TabulatedModel
from push_predictor.planning.particles import POSE_COVARIATES, model_of, push_particles, windows_of
from push_predictor.planning.persistence import Persistence, persistence_of, root_of
from push_predictor.types import Array

PARTICLES = 1000
MOST_PARTICLES = 100_000
MOST_WORK = 1_000_000  # particles times windows; takes some seconds
MOST_EXACT_WORK = 100_000  # without a tabulated model
FARTHEST = 1e6  # m, also for standard deviations; beyond it double precision loses millimetres
A_COVARIANCE = "a symmetric (3, 3) matrix of finite numbers without negative eigenvalues"
ROUNDING = 1e-6  # of a correlation; messages are often filled from single precision


@dataclass(frozen=True, eq=False)
class Rollout:
    """Predicted poses of the slider after each of k steps.

    mean (k, 3): x m, y m, heading rad (circular mean); covariance (k, 3, 3); samples (p, 3): poses after the last
    step; in_contact (k,): share of the samples that the tip still pushes at the end of the step; in_domain (k,): share
    of the samples for which all requests so far were in the model's domain.
    """

    mean: Array
    covariance: Array
    samples: Array
    in_contact: Array
    in_domain: Array


@one_blas_thread()
def rollout(
    predictor: PushModel | TabulatedModel,
    slider_mean: Array,
    slider_covariance: Array,
    steps: Array,
    particles: int = PARTICLES,
    seed: int = 0,
    persistence: Persistence | None = None,
    check_cancelled: Callable[[], None] | None = None,
    covariates: Mapping[str, Array] = MappingProxyType({}),
) -> Rollout:
    """Roll out steps (k, 4: velocity m/s, contact, angle rad, duration s) from a slider at slider_mean (3,) with
    slider_covariance (3, 3).

    persistence: correlation of the residuals within a step, None for that of the model's training pushes; steps are
    independent of each other. The same seed gives the same samples. check_cancelled is called before every window and
    may raise. covariates (k,) by name: of each step, for all of its windows; those that a pose gives must not be among
    them. Raises RequestError.
    """
    model, steps = model_of(predictor), np.asarray(steps, dtype=np.float64).reshape(-1, 4)
    _check(predictor, slider_mean, slider_covariance, steps, particles, covariates)
    persistence = persistence_of(model) if persistence is None else persistence
    rng = np.random.default_rng(seed)
    sliders = sample_poses(slider_mean, slider_covariance, particles, rng)
    known, rows = np.ones(particles, dtype=np.bool_), []
    for k, (*inputs, duration) in enumerate(steps.tolist()):
        every, given = np.tile(inputs, (particles, 1)), _of_step(covariates, k)
        pushed = push_particles(predictor, sliders, every, duration, persistence, rng, check_cancelled, given)
        sliders, known = pushed.sliders, known & pushed.in_domain
        rows.append((*pose_moments(sliders), pushed.in_contact.mean(), known.mean()))
    mean, covariance, in_contact, in_domain = zip(*rows, strict=True) if rows else ((), (), (), ())
    return Rollout(
        np.reshape(mean, (-1, 3)),
        np.reshape(covariance, (-1, 3, 3)),
        _wrapped(sliders),
        np.array(in_contact, dtype=np.float64),
        np.array(in_domain, dtype=np.float64),
    )


def sample_poses(mean: Array, covariance: Array, count: int, rng: np.random.Generator) -> Array:
    """Draw poses (count, 3) from a Gaussian; covariance (3, 3) may be singular."""
    matrix = np.asarray(covariance, dtype=np.float64)
    root = root_of(0.5 * (matrix + matrix.T)[None])[0]
    return np.asarray(mean + rng.standard_normal((count, 3)) @ root.T)


def pose_moments(poses: Array) -> tuple[Array, Array]:
    """Mean (3,) and covariance (3, 3) of poses (p, 3), with the circular mean of the heading."""
    heading = np.arctan2(np.mean(np.sin(poses[:, 2])), np.mean(np.cos(poses[:, 2])))
    mean = np.array([*poses[:, :2].mean(axis=0), heading])
    off = _wrapped(poses - mean)
    return mean, off.T @ off / len(poses)


def _wrapped(poses: Array) -> Array:
    return np.column_stack([poses[:, :2], wrap_angle(poses[:, 2])])


def _of_step(covariates: Mapping[str, Array], index: int) -> dict[str, float]:
    return {name: float(column[index]) for name, column in covariates.items()}


def _check(
    predictor: PushModel | TabulatedModel,
    mean: Array,
    covariance: Array,
    steps: Array,
    particles: int,
    covariates: Mapping[str, Array],
) -> None:
    model = model_of(predictor)
    for name in POSE_COVARIATES:
        if name in covariates:
            raise CovariateError("covariate_names", name, "covariates that do not follow from the poses")
    if not np.all(np.abs(mean) <= FARTHEST):
        accepted = f"numbers up to {FARTHEST:g}: x, y in m, heading in rad"
        raise RequestError("slider_mean", np.asarray(mean).tolist(), accepted)
    if not is_covariance(np.asarray(covariance)):
        raise RequestError("slider_covariance", np.asarray(covariance).tolist(), A_COVARIANCE)
    if not 0 < particles <= MOST_PARTICLES:
        raise RequestError("particles", particles, f"a number from 1 to {MOST_PARTICLES}")
    windows = sum(_checked_windows(model, k, step, _of_step(covariates, k)) for k, step in enumerate(steps.tolist()))
    tabulated = isinstance(predictor, TabulatedModel) and predictor.tabulated
    if windows * particles > (work := MOST_WORK if tabulated else MOST_EXACT_WORK):
        most = work // particles
        accepted = f"at most {most} windows in total with {particles} particles"
        raise TooLargeError("steps", f"{windows} windows", accepted)


def _checked_windows(model: PushModel, index: int, step: list[float], covariates: Mapping[str, float]) -> int:
    velocity, contact, angle, duration = step
    try:
        windows = windows_of(model, duration)
        complete = {**dict.fromkeys(POSE_COVARIATES, 0.0), **covariates}
        push = PushRequest(velocity, contact, angle, windows.asked, complete)
        check_request(model, push)
    except RequestError as error:
        raise error.within(f"steps[{index}]") from None
    return windows.count


def is_covariance(matrix: Array) -> bool:
    """Whether a matrix is (3, 3), finite, symmetric and positive semidefinite, up to rounding."""
    if matrix.shape != (3, 3) or not np.all(np.isfinite(matrix)):
        return False
    variances = np.diagonal(matrix)
    if np.any(variances < 0.0) or np.any(variances > FARTHEST**2):
        return False
    sd = np.sqrt(variances)
    scale = np.outer(sd, sd)
    if not np.all(np.abs(matrix - matrix.T) <= ROUNDING * scale):
        return False
    unit = np.where(sd > 0.0, sd, 1.0)
    smallest = np.linalg.eigvalsh(0.5 * (matrix + matrix.T) / np.outer(unit, unit))[0]
    return bool(np.all(np.abs(matrix) <= (1.0 + ROUNDING) * scale) and smallest >= -ROUNDING)
