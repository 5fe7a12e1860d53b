# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""RolloutPushes <-> a rollout in the plane of the world: a pose in space is projected, results are lifted again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovariance

from msg_adapters.predictions import covariates_of_push, covariates_of_pushes
from msg_adapters.slider_poses import FLAT, PLANAR, pose_of_message
from push_predictor.errors import RequestError, TooLargeError
from push_predictor.geometry.frames import yaw_of_quaternion
from push_predictor.geometry.spatial import SpatialPose
from push_predictor.models.request import OUT_OF_DOMAIN
from push_predictor.planning.rollout import A_COVARIANCE, FARTHEST, MOST_PARTICLES, Rollout, is_covariance
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class RolloutQuery:
    """A request in its own frame. model: a name, empty for the default one.

    slider with covariance (6, 6); steps (k, 4): velocity m/s, contact, angle rad, duration s; number of samples; seed;
    covariates (k,) by name, of each step.
    """

    model: str
    slider: SpatialPose
    covariance: Array
    steps: Array
    samples: int
    seed: int
    covariates: dict[str, Array]


@dataclass(frozen=True, eq=False)
class WorldSlider:
    """A slider flat in the world: pose in space, planar pose (3,: x, y m, heading rad) and its covariance (3, 3)."""

    pose: SpatialPose
    planar: Array
    covariance: Array


def query_from_rollout_request(request: Any) -> RolloutQuery:
    """The query of a RolloutPushes request; the rollout checks its steps.

    Raises RequestError for a pose that is not finite, a quaternion not of unit length, too many particles, and
    covariates whose values do not match their names.
    """
    if request.particles > MOST_PARTICLES:
        raise TooLargeError("particles", request.particles, f"at most {MOST_PARTICLES}")
    steps = [(step.velocity, step.contact, step.angle, step.duration) for step in request.steps]
    return RolloutQuery(
        request.model,
        pose_of_message("slider.pose", request.slider.pose),
        np.array(request.slider.covariance, dtype=np.float64).reshape(6, 6),
        np.reshape(np.array(steps, dtype=np.float64), (-1, 4)),
        request.particles,
        request.seed,
        _covariates(request, len(steps)),
    )


def _covariates(request: Any, count: int) -> dict[str, Array]:
    """The covariates (count,) of each step by name; one value per name applies to all steps. Raises CovariateError."""
    if len(request.covariate_values) == len(request.covariate_names):
        return {name: np.full(count, value) for name, value in covariates_of_push(request).items()}
    return covariates_of_pushes(request, count)


def world_slider(query: RolloutQuery, frame: SpatialPose) -> WorldSlider:
    """The slider of a query whose frame has the pose `frame` in the world.

    Of the covariance only x, y and the rotation about z in the world's plane are used. Raises RequestError if the
    slider does not lie flat, or these three have no valid covariance.
    """
    slider = frame @ query.slider
    if slider.tilt > FLAT:
        raise RequestError("slider.pose.orientation tilt", round(slider.tilt, 4), f"a slider flat within {FLAT:g} rad")
    for index in np.flatnonzero(~np.isfinite(query.covariance.ravel()))[:1]:
        raise RequestError(f"slider.covariance[{index}]", float(query.covariance.ravel()[index]), "a finite number")
    covariance = frame.covariance(query.covariance)[PLANAR]
    if not is_covariance(covariance):
        accepted = f"{A_COVARIANCE} of x, y and the rotation about z"
        raise RequestError("slider.covariance", covariance.tolist(), accepted)
    if not np.all(np.abs(slider.position) <= FARTHEST):
        raise RequestError("slider.pose.position", slider.position.tolist(), f"a place within {FARTHEST:g} m")
    planar = np.array([*slider.position[:2], yaw_of_quaternion(*slider.quaternion)])
    return WorldSlider(slider, planar, covariance)


def fill_rollout_response(
    response: Any, frame: SpatialPose, slider: WorldSlider, rolled: Rollout, samples: int
) -> None:
    """Write a rollout in the frame of the request; height and small tilt of the slider do not change.

    Covariances are those of x, y and the heading in the world's plane, and zero elsewhere.
    """
    to_request = frame.inverse
    response.poses = [
        _pose_message(to_request @ _moved(slider, mean), to_request.covariance(_in_space(covariance)))
        for mean, covariance in zip(rolled.mean, rolled.covariance, strict=True)
    ]
    response.samples = seen_from(to_request, slider, rolled.samples[:samples]).ravel().tolist()
    response.message = remarks(rolled)
    response.success = True


def seen_from(to_request: SpatialPose, slider: WorldSlider, poses: Array) -> Array:
    """Planar poses (p, 3) of the slider in the world as x, y and heading (p, 3) in the request's frame."""
    height = np.full(len(poses), slider.pose.position[2])
    place = np.column_stack([poses[:, :2], height]) @ to_request.rotation.T + to_request.position
    ahead = slider.pose.rotation[:, 0]
    turn = poses[:, 2] - slider.planar[2]
    turned = np.column_stack(
        [
            np.cos(turn) * ahead[0] - np.sin(turn) * ahead[1],
            np.sin(turn) * ahead[0] + np.cos(turn) * ahead[1],
            np.full(len(poses), ahead[2]),
        ]
    )
    forward = turned @ to_request.rotation.T
    return np.column_stack([place[:, :2], np.arctan2(forward[:, 1], forward[:, 0])])


def remarks(rolled: Rollout) -> str:
    """In words, what a planner should know of a rollout; empty if every sample stays in the domain and in contact."""
    found = []
    if outside := [k for k, share in enumerate(rolled.in_domain) if share < 1.0]:
        percent = 100.0 * (1.0 - rolled.in_domain[-1])
        found.append(
            f"{OUT_OF_DOMAIN}: {percent:.3g} % of the samples leave the domain of the training data, "
            f"from steps[{outside[0]}] on"
        )
    for k, share in enumerate(rolled.in_contact):
        if share < 1.0:
            found.append(f"{100.0 * (1.0 - share):.3g} % of the samples have lost contact at the end of steps[{k}]")
    return "; ".join(found)


def _moved(slider: WorldSlider, planar: Array) -> SpatialPose:
    there = SpatialPose(np.array([*planar[:2], slider.pose.position[2]]), slider.pose.quaternion)
    return there.turned(float(planar[2] - slider.planar[2]))


def _in_space(covariance: Array) -> Array:
    matrix = np.zeros((6, 6))
    matrix[PLANAR] = covariance
    return matrix


def _pose_message(pose: SpatialPose, covariance: Array) -> PoseWithCovariance:
    message = PoseWithCovariance(covariance=covariance.reshape(36))
    position, turn = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = pose.position.tolist()
    turn.x, turn.y, turn.z, turn.w = pose.quaternion.tolist()
    return message
