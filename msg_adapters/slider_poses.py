# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""PredictSliderPose <-> a push in the plane of the world: poses in space are projected, and lifted again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped

from msg_adapters.predictions import covariates_of_push
from msg_adapters.stamps import ns_to_stamp, stamp_to_ns
from push_predictor.errors import RequestError
from push_predictor.geometry.frames import yaw_of_quaternion
from push_predictor.geometry.spatial import SpatialPose
from push_predictor.planning.slider_pose import SliderAfter, WorldPush
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.types import Array

NORM_TOLERANCE = 1e-3  # of a unit quaternion; float32 stays far below
FLAT = 0.1  # rad out of the plane: there a projection is off by 0.5 %
LIFT = WindowOptions().lift
PLANAR = np.ix_([0, 1, 5], [0, 1, 5])  # x, y and the rotation about z among x, y, z, rotations about x, y, z


@dataclass(frozen=True, eq=False)
class SliderPoseQuery:
    """A request in its own frame: slider; pusher (3,) m; velocity (3,) m/s; duration s; covariates.

    model: a name, empty for the default one.
    """

    model: str
    slider: SpatialPose
    pusher: Array
    velocity: Array
    duration: float
    covariates: dict[str, float]


def query_from_slider_request(request: Any) -> SliderPoseQuery:
    """The query of a PredictSliderPose request.

    Raises RequestError for a number that is not finite, a quaternion that is not of unit length, and covariates whose
    values do not match their names.
    """
    return SliderPoseQuery(
        request.model,
        pose_of_message("slider", request.slider),
        _vector("pusher", request.pusher),
        _vector("pusher_velocity", request.pusher_velocity),
        request.duration,
        covariates_of_push(request),
    )


def world_push(query: SliderPoseQuery, frame: SpatialPose) -> WorldPush:
    """The push in the world of a query whose frame has the pose `frame` there.

    Raises RequestError if the slider does not lie flat, the tip is lifted off it or its motion leaves the plane.
    """
    slider, pusher, velocity = frame @ query.slider, frame.point(query.pusher), frame.vector(query.velocity)
    if slider.tilt > FLAT:
        raise RequestError("slider.orientation tilt", round(slider.tilt, 4), f"a slider flat within {FLAT:g} rad")
    if (height := pusher[2] - slider.position[2]) > LIFT:
        accepted = f"a tip at most {LIFT:g} m above the slider's frame; it is lifted by {height:.3g} m"
        raise RequestError("pusher.z", round(float(pusher[2]), 6), accepted)
    if abs(velocity[2]) > FLAT * np.hypot(*velocity[:2]):
        accepted = f"a velocity within {FLAT:g} rad of the plane that the slider lies in"
        raise RequestError("pusher_velocity.z", round(float(velocity[2]), 6), accepted)
    planar = np.array([*slider.position[:2], yaw_of_quaternion(*slider.quaternion)])
    return WorldPush(planar, pusher[:2], velocity[:2], query.duration, query.covariates)


def fill_slider_response(
    response: Any, header: Any, query: SliderPoseQuery, frame: SpatialPose, push: WorldPush, after: SliderAfter
) -> None:
    """Write the slider's pose after the push, in the frame of the request; height and small tilt do not change.

    The covariance is that of x, y and the heading in the world's plane, and zero elsewhere. The stamp is the request's
    plus the duration; a zero stamp (unknown time) stays zero. Raises MessageError for a time beyond 32-bit seconds.
    """
    before = frame @ query.slider
    moved = SpatialPose(np.array([*after.pose[:2], before.position[2]]), before.quaternion)
    covariance = np.zeros((6, 6))
    covariance[PLANAR] = after.covariance
    to_request = frame.inverse
    answer = response.slider_after
    answer.header.frame_id = header.frame_id
    if stamp := stamp_to_ns(header.stamp):
        answer.header.stamp = ns_to_stamp(stamp + round(push.duration * 1e9))
    _fill_pose(answer, to_request @ moved.turned(float(after.pose[2] - push.slider[2])))
    spread = to_request.covariance(covariance)
    answer.pose.covariance = (0.5 * (spread + spread.T)).reshape(36)  # exactly symmetric, in spite of rounding
    response.in_domain, response.message = after.in_domain, after.remark
    response.success = True


def pose_of_message(field: str, pose: Any) -> SpatialPose:
    """A geometry_msgs/Pose. Raises RequestError naming `field`: not finite, or a quaternion not of unit length."""
    return _pose(f"{field}.position", pose.position, f"{field}.orientation", pose.orientation)


def pose_of_transform(transform: Any) -> SpatialPose:
    """A geometry_msgs/Transform. Raises RequestError, as `pose_of_message` does."""
    return _pose("transform.translation", transform.translation, "transform.rotation", transform.rotation)


def _pose(place: str, position: Any, turn: str, quaternion: Any) -> SpatialPose:
    where, turned = _vector(place, position), _vector(turn, quaternion)
    norm = float(np.linalg.norm(turned))
    if abs(norm - 1.0) > NORM_TOLERANCE:
        raise RequestError(f"{turn} norm", norm, f"a unit quaternion (within {NORM_TOLERANCE:g})")
    return SpatialPose(where, turned / norm)


def _fill_pose(answer: PoseWithCovarianceStamped, pose: SpatialPose) -> None:
    position, turn = answer.pose.pose.position, answer.pose.pose.orientation
    position.x, position.y, position.z = pose.position.tolist()
    turn.x, turn.y, turn.z, turn.w = pose.quaternion.tolist()


def _vector(field: str, message: Any) -> Array:
    axes = "xyzw" if hasattr(message, "w") else "xyz"
    for axis in axes:
        if not np.isfinite(value := getattr(message, axis)):
            raise RequestError(f"{field}.{axis}", value, "a finite number")
    return np.array([getattr(message, axis) for axis in axes], dtype=np.float64)
