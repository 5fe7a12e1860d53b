"""Cutting one window out of the tracks: contact, velocity, angle and what became of the slider."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, to_body, wrap_angle
from push_predictor.geometry.outline import Outline, Projection
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.contact import FIT_SPAN
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.recordings.windows.track import NANOSECOND, Track
from push_predictor.types import Array

SUNK, SUNK_SHARE = 0.0005, 0.5  # m, and of the tip's way: a tip that goes so far into the slider does not push it
OUTRAN, OUTRAN_SHARE = 0.002, 1.25  # m, and of the tip's way: a slider that goes farther is moved by something else
FIT_SAMPLES = 4  # or this many samples, where those take longer


@dataclass(frozen=True, eq=False)
class Line:
    """The pusher at a window's start: position (2,) m and velocity (2,) m/s."""

    position: Array
    velocity: Array


@dataclass(frozen=True, eq=False)
class Tracks:
    """The streams; wrench is None where there is none."""

    slider: Track
    pusher: Track
    wrench: Track | None


@dataclass(frozen=True, eq=False)
class PushContext:
    """What a window inherits from its push.

    push_id, push_index; first_touch ns; dwell: s without contact before it; tare: the force without contact (2,) N,
    None where unknown; last_edge: that of the window before, None for the first; window_index: within the push.
    """

    push_id: str
    push_index: int
    first_touch: int
    dwell: float
    tare: Array | None
    last_edge: int | None
    window_index: int


def cut_window(
    rig: Rig,
    tracks: Tracks,
    origin: int,
    start: int,
    end: int,
    push: PushContext,
    slid: float,
) -> PushWindow | str:
    """Cut the window from start to end (ns), or answer why it is none (a kind of stream_faults.FAULTS).

    slid: m that the slider has been pushed so far.
    """
    begin, finish = (start - origin) * NANOSECOND, (end - origin) * NANOSECOND
    pose, pose_after = tracks.slider.at(np.array([begin, finish]))[:, [0, 1, 3]]
    line = pusher_line(tracks.pusher, begin)
    touch = rig.outline.project(to_body(line.position, pose)[None])
    edge, contact = contact_at(rig.outline, touch, push.last_edge)
    normal = rotate(rig.outline.inward_normal(np.array([contact]))[0], pose[2])
    heading = float(np.arctan2(line.velocity[1], line.velocity[0]))
    angle = float(wrap_angle(np.array(heading - np.arctan2(normal[1], normal[0]))))
    speed = float(np.hypot(*line.velocity))
    if not (abs(angle) < np.pi / 2.0 and speed > 0.0):
        return "not_a_push"
    if fault := _impossible(rig, tracks, np.array([begin, finish])):
        return fault
    moved = rotate(pose_after[:2] - pose[:2], np.array(-heading))
    return PushWindow(
        push_id=push.push_id,
        index=push.window_index,
        start=start,
        end=end,
        velocity=speed,
        contact=contact,
        angle=angle,
        duration=(end - start) * NANOSECOND,
        displacement=np.array([moved[0], moved[1], pose_after[2] - pose[2]]),
        slider_start=pose,
        slider_end=pose_after,
        push_heading=heading,
        covariates={
            "slid_distance": slid,
            "push_heading": heading,
            "edge": float(edge),
            "contact_gap": float(touch.distance[0] - rig.pusher_radius),
            **_conditions(pose, start, push),
            **_forces(tracks.wrench, begin, finish, push.tare, normal),
        },
    )


def _impossible(rig: Rig, tracks: Tracks, times: Array) -> str:
    """What cannot be between two times (s) of a push, empty if all can."""
    poses, tips = tracks.slider.at(times)[:, [0, 1, 3]], tracks.pusher.at(times)[:, :2]
    driven, moved = np.hypot(*(tips[1] - tips[0])), np.hypot(*(poses[1] - poses[0])[:2])
    before, after = rig.outline.project(to_body(tips, poses)).distance
    if before - after > max(SUNK, SUNK_SHARE * driven):
        return "left_behind"
    return "outran" if moved > OUTRAN + OUTRAN_SHARE * driven else ""


def _conditions(pose: Array, start: int, push: PushContext) -> dict[str, float]:
    return {
        "push_index": float(push.push_index),
        "dwell_time": push.dwell,
        "time_since_contact": (start - push.first_touch) * NANOSECOND,
        "slider_x": float(pose[0]),
        "slider_y": float(pose[1]),
        "slider_heading": float(wrap_angle(pose[2])),
    }


def pusher_line(pusher: Track, begin: float) -> Line:
    """Least-squares line through the pusher's first samples of a window that begins at `begin` (s)."""
    first = int(np.searchsorted(pusher.time, begin))
    last = max(int(np.searchsorted(pusher.time, begin + FIT_SPAN, side="right")), first + FIT_SAMPLES)
    time = pusher.time[first:last] - begin
    design = np.column_stack([np.ones_like(time), time])
    solution = np.linalg.lstsq(design, pusher.values[first:last, :2], rcond=None)[0]
    return Line(solution[0], solution[1])


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
    """The one of two edges that faces the pusher more squarely."""
    middles = outline.edge_starts[[before, after]] + 0.5 * np.diff(outline.edge_starts)[[before, after]]
    return (before, after)[int(np.argmin(outline.inward_normal(middles) @ normal))]


def _forces(wrench: Track | None, begin: float, finish: float, tare: Array | None, normal: Array) -> dict[str, float]:
    """Mean force of the pusher on the slider in the window: along the inward normal, and to the left of it."""
    if wrench is None:
        return {}
    inside = (wrench.time >= begin) & (wrench.time <= finish)
    if not np.any(inside):
        return {}
    force = wrench.values[inside, :2].mean(axis=0) - (np.zeros(2) if tare is None else tare)
    on_slider = -force  # the wrench is what the slider exerts on the pusher
    left = np.array([-normal[1], normal[0]])
    return {"normal_force": float(on_slider @ normal), "tangential_force": float(on_slider @ left)}
