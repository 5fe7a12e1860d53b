# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""PredictSliderPose and RolloutPushes <-> the plane of the world: poses in space are projected, and lifted again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovariance

from msg_adapters import ns_to_stamp, stamp_to_ns
from msg_adapters.predictions import covariates_of_push, covariates_of_pushes
from push_predictor.errors import RequestError, TooLargeError
from push_predictor.geometry.frames import SpatialPose, yaw_of_quaternion
from push_predictor.models.request import OUT_OF_DOMAIN
from push_predictor.planning.rollout import A_COVARIANCE, FARTHEST, MOST_PARTICLES, Rollout, is_covariance
from push_predictor.planning.slider_pose import SliderAfter, WorldPush
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.types import Array

NORM_TOLERANCE = 1e-3  # of a unit quaternion; float32 stays far below
FLAT = 0.1  # rad out of the plane: there a projection is off by 0.5 %
LIFT = WindowOptions().lift
PLANAR = np.ix_([0, 1, 5], [0, 1, 5])  # x, y and the rotation about z among x, y, z, rotations about x, y, z


@dataclass(frozen=True, eq=False)
class WorldSlider:
    """A slider flat in the world: pose in space, and planar pose (3,: x, y m, heading rad)."""

    pose: SpatialPose
    planar: Array

    def moved(self, planar: Array) -> SpatialPose:
        """Its pose in space at another planar pose (3,); height and small tilt do not change."""
        there = SpatialPose(np.array([*planar[:2], self.pose.position[2]]), self.pose.quaternion)
        return there.turned(float(planar[2] - self.planar[2]))


def world_slider(field: str, pose: Any, frame: SpatialPose) -> WorldSlider:
    """The slider with a geometry_msgs/Pose in a frame that has the pose `frame` in the world.

    Raises RequestError that names `field` for a pose that is not valid, and for a slider that does not lie flat.
    """
    slider = frame @ _pose(f"{field}.position", pose.position, f"{field}.orientation", pose.orientation)
    if slider.tilt > FLAT:
        raise RequestError(f"{field}.orientation tilt", round(slider.tilt, 4), f"a slider flat within {FLAT:g} rad")
    return WorldSlider(slider, np.array([*slider.position[:2], yaw_of_quaternion(*slider.quaternion)]))


def pose_of_transform(transform: Any) -> SpatialPose:
    """A geometry_msgs/Transform. Raises RequestError: not finite, or a quaternion not of unit length."""
    return _pose("transform.translation", transform.translation, "transform.rotation", transform.rotation)


# --- PredictSliderPose -----------------------------------------------------------------------------------------------


def world_push(request: Any, slider: WorldSlider, frame: SpatialPose, duration: float) -> WorldPush:
    """The push of a PredictSliderPose request in the world; duration: s, of the window.

    Raises RequestError for a number that is not finite, a tip that is lifted off the slider, a motion that leaves the
    plane, and covariates whose values do not match their names.
    """
    pusher = frame.point(_vector("pusher", request.pusher))
    velocity = frame.vector(_vector("pusher_velocity", request.pusher_velocity))
    if (height := pusher[2] - slider.pose.position[2]) > LIFT:
        accepted = f"a tip at most {LIFT:g} m above the slider's frame; it is lifted by {height:.3g} m"
        raise RequestError("pusher.z", round(float(pusher[2]), 6), accepted)
    if abs(velocity[2]) > FLAT * np.hypot(*velocity[:2]):
        accepted = f"a velocity within {FLAT:g} rad of the plane that the slider lies in"
        raise RequestError("pusher_velocity.z", round(float(velocity[2]), 6), accepted)
    return WorldPush(slider.planar, pusher[:2], velocity[:2], duration, covariates_of_push(request))


def fill_slider_response(
    response: Any, header: Any, frame: SpatialPose, slider: WorldSlider, duration: float, after: SliderAfter
) -> None:
    """Write the slider's pose after a push of so many s, in the frame of the request.

    The covariance is that of x, y and the heading in the world's plane, and zero elsewhere. The stamp is the request's
    plus the duration; a zero stamp (unknown time) stays zero. Raises RequestError for a time beyond 32-bit seconds.
    """
    answer = response.slider_after
    answer.header.frame_id = header.frame_id
    if stamp := stamp_to_ns(header.stamp):
        answer.header.stamp = ns_to_stamp(stamp + round(duration * 1e9))
    answer.pose = _pose_message(frame.inverse, slider.moved(after.pose), after.covariance)
    response.in_domain, response.message = after.in_domain, after.remark
    response.success = True


# --- RolloutPushes ---------------------------------------------------------------------------------------------------


def steps_from_request(request: Any) -> tuple[Array, dict[str, Array]]:
    """The steps (k, 4: velocity m/s, contact, angle rad, duration s), and the covariates (k,) of each by name.

    One value per name applies to all steps. Raises TooLargeError for too many particles, CovariateError for values
    that do not match their names.
    """
    if request.particles > MOST_PARTICLES:
        raise TooLargeError("particles", request.particles, f"at most {MOST_PARTICLES}")
    rows = [(step.velocity, step.contact, step.angle, step.duration) for step in request.steps]
    steps = np.reshape(np.array(rows, dtype=np.float64), (-1, 4))
    if len(request.covariate_values) == len(request.covariate_names):
        covariates = {name: np.full(len(steps), value) for name, value in covariates_of_push(request).items()}
    else:
        covariates = covariates_of_pushes(request, len(steps))
    return steps, covariates


def world_start(request: Any, frame: SpatialPose) -> tuple[WorldSlider, Array]:
    """The slider of a RolloutPushes request in the world, and the covariance (3, 3) of its planar pose.

    Of the covariance only x, y and the rotation about z in the world's plane are used. Raises RequestError as
    `world_slider` does, for a place too far away, and if these three have no valid covariance.
    """
    slider = world_slider("slider.pose", request.slider.pose, frame)
    given = np.array(request.slider.covariance, dtype=np.float64)
    for index in np.flatnonzero(~np.isfinite(given))[:1]:
        raise RequestError(f"slider.covariance[{index}]", float(given[index]), "a finite number")
    covariance = frame.covariance(given.reshape(6, 6))[PLANAR]
    if not is_covariance(covariance):
        accepted = f"{A_COVARIANCE} of x, y and the rotation about z"
        raise RequestError("slider.covariance", covariance.tolist(), accepted)
    if not np.all(np.abs(slider.pose.position) <= FARTHEST):
        raise RequestError("slider.pose.position", slider.pose.position.tolist(), f"a place within {FARTHEST:g} m")
    return slider, covariance


def fill_rollout_response(
    response: Any, frame: SpatialPose, slider: WorldSlider, rolled: Rollout, samples: int
) -> None:
    """Write a rollout in the frame of the request; covariances are zero outside the world's plane."""
    to_request = frame.inverse
    response.poses = [
        _pose_message(to_request, slider.moved(mean), covariance)
        for mean, covariance in zip(rolled.mean, rolled.covariance, strict=True)
    ]
    response.samples = _seen_from(to_request, slider, rolled.samples[:samples]).ravel().tolist()
    response.message = remarks(rolled)
    response.success = True


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


def _seen_from(to_request: SpatialPose, slider: WorldSlider, poses: Array) -> Array:
    """Planar poses (p, 3) of the slider in the world as x, y and heading (p, 3) in the request's frame."""
    height = np.full(len(poses), slider.pose.position[2])
    place = np.column_stack([poses[:, :2], height]) @ to_request.rotation.T + to_request.position
    x, y, z = slider.pose.rotation[:, 0]
    cos, sin = np.cos(poses[:, 2] - slider.planar[2]), np.sin(poses[:, 2] - slider.planar[2])
    turned = np.column_stack([cos * x - sin * y, sin * x + cos * y, np.full(len(poses), z)])
    forward = turned @ to_request.rotation.T
    return np.column_stack([place[:, :2], np.arctan2(forward[:, 1], forward[:, 0])])


# --- poses -----------------------------------------------------------------------------------------------------------


def _pose_message(to_request: SpatialPose, pose: SpatialPose, planar: Array) -> PoseWithCovariance:
    """A pose in the world and the covariance (3, 3) in its plane, in the frame of the request."""
    there, covariance = to_request @ pose, np.zeros((6, 6))
    covariance[PLANAR] = planar
    spread = to_request.covariance(covariance)
    message = PoseWithCovariance(covariance=(0.5 * (spread + spread.T)).reshape(36))  # symmetric in spite of rounding
    position, turn = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = there.position.tolist()
    turn.x, turn.y, turn.z, turn.w = there.quaternion.tolist()
    return message


def _pose(place: str, position: Any, turn: str, quaternion: Any) -> SpatialPose:
    where, turned = _vector(place, position), _vector(turn, quaternion)
    norm = float(np.linalg.norm(turned))
    if abs(norm - 1.0) > NORM_TOLERANCE:
        raise RequestError(f"{turn} norm", norm, f"a unit quaternion (within {NORM_TOLERANCE:g})")
    return SpatialPose(where, turned / norm)


def _vector(field: str, message: Any) -> Array:
    axes = "xyzw" if hasattr(message, "w") else "xyz"
    for axis in axes:
        if not np.isfinite(value := getattr(message, axis)):
            raise RequestError(f"{field}.{axis}", value, "a finite number")
    return np.array([getattr(message, axis) for axis in axes], dtype=np.float64)
