# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Cut one window out of the tracks: contact, velocity, angle and the slider's displacement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, to_body, wrap_angle
from push_predictor.geometry.outline import Outline, Projection
from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.contact import FIT_SPAN
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.recordings.windows.track import Track
from push_predictor.types import Array

ENTERED, ENTERED_SHARE = 0.0005, 0.5  # m, share of the tip's displacement: a tip this much deeper enters the outline
OUTRAN, OUTRAN_SHARE = 0.002, 1.25  # m, share of the tip's displacement: a slider this much farther is not pushed
FIT_SAMPLES = 4  # or this many samples, where those take longer


@dataclass(frozen=True, eq=False)
class PushContext:
    """The properties of a push that its windows share.

    push_id, push_index; first_touch ns; dwell: s without contact before it; tare: the force without contact (2,) N,
    None if unknown; last_edge: of the previous window, None for the first; window_index: within the push.
    """

    push_id: str
    push_index: int
    first_touch: int
    dwell: float
    tare: Array | None
    last_edge: int | None
    window_index: int


@dataclass(frozen=True, eq=False)
class _Command:
    """The command of a window.

    edge, contact, gap m, inward normal (2,) in the world, heading rad, angle rad, speed m/s.
    """

    edge: int
    contact: float
    gap: float
    normal: Array
    heading: float
    angle: float
    speed: float


def cut_window(
    rig: Rig, tracks: Mapping[str, Track], start: int, end: int, origin: int, push: PushContext, slid: float
) -> PushWindow | str:
    """Cut a window from start to end (ns), or return the fault (a key of FAULTS) for which it is rejected.

    tracks: by sensor; that of the wrench may be empty. origin: stamp (ns) from which they count their time. slid:
    distance (m) that the slider has been pushed so far.
    """
    times, pusher = np.array([start - origin, end - origin]) * NANOSECOND, tracks["pusher"]
    poses = tracks["slider"].at(times)[:, [0, 1, 3]]
    pose, pose_after = poses
    command = _command(rig, *pusher_motion(pusher, float(times[0])), pose, push.last_edge)
    if not (abs(command.angle) < np.pi / 2.0 and command.speed > 0.0):
        return "not_a_push"
    if fault := _motion_fault(rig, poses, pusher.at(times)[:, :2]):
        return fault
    moved = rotate(pose_after[:2] - pose[:2], np.array(-command.heading))
    return PushWindow(
        push_id=push.push_id,
        index=push.window_index,
        start=start,
        end=end,
        velocity=command.speed,
        contact=command.contact,
        angle=command.angle,
        duration=(end - start) * NANOSECOND,
        displacement=np.array([moved[0], moved[1], pose_after[2] - pose[2]]),
        slider_start=pose,
        slider_end=pose_after,
        push_heading=command.heading,
        covariates={
            "slid_distance": slid,
            **_conditions(command, pose, start, push),
            **_forces(tracks["wrench"], times, push.tare, command.normal),
        },
    )


def _command(rig: Rig, position: Array, velocity: Array, pose: Array, last_edge: int | None) -> _Command:
    """The command of a pusher at (2,) m with a velocity (2,) m/s, at a slider with the given pose (3,)."""
    touch = rig.outline.project(to_body(position, pose)[None])
    edge, contact = contact_at(rig.outline, touch, last_edge)
    normal = rotate(rig.outline.inward_normal(np.array([contact]))[0], pose[2])
    heading = float(np.arctan2(velocity[1], velocity[0]))
    angle = float(wrap_angle(np.array(heading - np.arctan2(normal[1], normal[0]))))
    gap = float(touch.distance[0] - rig.pusher_radius)
    return _Command(edge, contact, gap, normal, heading, angle, float(np.hypot(*velocity)))


def _motion_fault(rig: Rig, poses: Array, tips: Array) -> str:
    """The fault of a motion that no push explains, empty without one: poses (2, 3) and tips (2, 2) at both ends."""
    driven, moved = np.hypot(*(tips[1] - tips[0])), np.hypot(*(poses[1] - poses[0])[:2])
    before, after = rig.outline.project(to_body(tips, poses)).distance
    if before - after > max(ENTERED, ENTERED_SHARE * driven):
        return "left_behind"
    return "outran" if moved > OUTRAN + OUTRAN_SHARE * driven else ""


def _conditions(command: _Command, pose: Array, start: int, push: PushContext) -> dict[str, float]:
    """The covariates that follow from geometry and time."""
    return {
        "push_heading": command.heading,
        "edge": float(command.edge),
        "contact_gap": command.gap,
        "push_index": float(push.push_index),
        "dwell_time": push.dwell,
        "time_since_contact": (start - push.first_touch) * NANOSECOND,
        "slider_x": float(pose[0]),
        "slider_y": float(pose[1]),
        "slider_heading": float(wrap_angle(pose[2])),
    }


def pusher_motion(pusher: Track, begin: float) -> tuple[Array, Array]:
    """Position (2,) m and velocity (2,) m/s at `begin` (s), by a least-squares line through the first samples."""
    first = int(np.searchsorted(pusher.time, begin))
    last = max(int(np.searchsorted(pusher.time, begin + FIT_SPAN, side="right")), first + FIT_SAMPLES)
    time = pusher.time[first:last] - begin
    design = np.column_stack([np.ones_like(time), time])
    solution = np.linalg.lstsq(design, pusher.values[first:last, :2], rcond=None)[0]
    return solution[0], solution[1]


def contact_at(outline: Outline, touch: Projection, last_edge: int | None) -> tuple[int, float]:
    """Edge and contact of a touch; at a vertex the contact belongs to the edge it slid along."""
    edge = int(outline.edge(touch.contact)[0][0])
    contact = float(touch.contact[0])
    if not touch.at_vertex[0]:
        return edge, contact
    count = len(outline.vertices)
    vertex = int(np.argmin(np.linalg.norm(outline.vertices - touch.point[0], axis=1)))
    before, after = (vertex - 1) % count, vertex
    chosen = last_edge if last_edge in (before, after) else _facing(outline, touch.normal[0], before, after)
    return chosen, float(outline.contact_on_edge(chosen, 1.0 if chosen == before else 0.0))


def _facing(outline: Outline, normal: Array, before: int, after: int) -> int:
    """The one of two edges that faces the pusher more directly."""
    middles = outline.edge_starts[[before, after]] + 0.5 * np.diff(outline.edge_starts)[[before, after]]
    return (before, after)[int(np.argmin(outline.inward_normal(middles) @ normal))]


def _forces(wrench: Track, times: Array, tare: Array | None, normal: Array) -> dict[str, float]:
    """Mean force of the pusher on the slider between two times (2,): along the inward normal, and to its left.

    tare: what the sensor reads without contact (2,); it is subtracted, and kept to judge the sensor's bias.
    """
    zero = {} if tare is None else {"free_force_x": float(tare[0]), "free_force_y": float(tare[1])}
    begin, end = np.searchsorted(wrench.time, times[0]), np.searchsorted(wrench.time, times[1], side="right")
    if begin >= end:
        return zero
    force = wrench.values[begin:end, :2].mean(axis=0) - (np.zeros(2) if tare is None else tare)
    on_slider = -force  # the wrench is the force of the slider on the pusher
    left = np.array([-normal[1], normal[0]])
    return {"normal_force": float(on_slider @ normal), "tangential_force": float(on_slider @ left), **zero}
