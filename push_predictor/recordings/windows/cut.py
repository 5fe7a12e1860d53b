# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Cut windows out of the tracks: contact, velocity, angle and the slider's displacement."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, to_body, wrap_angle
from push_predictor.geometry.outline import Outline, Projection
from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.contact import FIT_SPAN
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.recordings.windows.resolution import part_lines, part_means, part_rows
from push_predictor.recordings.windows.track import Track
from push_predictor.types import Array, IntArray

ENTERED, ENTERED_SHARE = 0.0005, 0.5  # m, share of the tip's displacement: a tip this much deeper enters the outline
OUTRAN, OUTRAN_SHARE = 0.002, 1.25  # m, share of the tip's displacement: a slider this much farther is not pushed
FIT_SAMPLES = 4  # or this many samples, where those take longer


@dataclass(frozen=True, eq=False)
class PushContext:
    """The properties of a push that its windows share.

    push_id, push_index; first_touch ns; dwell: s without contact before it; tare: x and y of the force without
    contact, N, None if unknown.
    """

    push_id: str
    push_index: int
    first_touch: int
    dwell: float
    tare: tuple[float, float] | None


@dataclass(frozen=True, eq=False)
class _Motions:
    """The motion of slider and tip in n windows.

    poses (2, n, 3) and tips (2, n, 2) at both ends. speed, heading (n,): of the tip at the start; touch: of the tip
    there. contact, edge, angle (n,), inward normal (n, 2) in the world. displacement (n, 3) in the push frame.
    """

    poses: Array
    tips: Array
    speed: Array
    heading: Array
    touch: Projection
    contact: Array
    edge: IntArray
    normal: Array
    angle: Array
    displacement: Array


class WindowCutter:
    """Cuts windows, those of one push after the other. counts: rejected windows by fault, a key of FAULTS."""

    def __init__(self, rig: Rig, least_speed: float) -> None:
        self.counts: Counter[str] = Counter()
        self._rig, self._least_speed = rig, least_speed
        self._slid = 0.0  # m; summed over windows: summed over samples, the tracker's noise would count as distance
        self._push, self._edge, self._index = -1, -1, 0  # of the last window: its push, edge and number in the push

    def cut(
        self, tracks: Mapping[str, Track], due: Sequence[tuple[int, int, PushContext]], origin: int, first: int
    ) -> list[PushWindow]:
        """The accepted ones of the windows that are due, in order: start and end in ns, and the push.

        tracks: by sensor; that of the wrench may be empty. origin: stamp (ns) from which they count their time; first:
        from which the elapsed time counts.
        """
        if not due:
            return []
        times = (np.array([[start, end] for start, end, _ in due]).T - origin) * NANOSECOND
        motions = _motions(self._rig.outline, tracks["slider"], tracks["pusher"], times)
        forces = _forces(tracks["wrench"], times)
        faults, found = _faults(self._rig, motions), list[PushWindow]()
        for k, (start, end, push) in enumerate(due):
            if push.push_index != self._push:
                self._push, self._edge, self._index = push.push_index, -1, 0
            if motions.touch.at_vertex[k]:
                self._keep_edge(motions, k)
            pushes = abs(motions.angle[k]) < np.pi / 2.0 and motions.speed[k] >= self._least_speed
            if fault := faults[k] if pushes else "not_a_push":
                self.counts[fault] += 1
                continue
            covariates = {"elapsed_time": (start - first) * NANOSECOND, "slid_distance": self._slid}
            covariates |= self._conditions(motions, k, start, push) | _on_slider(
                forces[k], push.tare, motions.normal[k]
            )
            window = PushWindow(
                push_id=push.push_id,
                index=self._index,
                start=start,
                end=end,
                velocity=float(motions.speed[k]),
                contact=float(motions.contact[k]),
                angle=float(motions.angle[k]),
                duration=(end - start) * NANOSECOND,
                displacement=motions.displacement[k],
                slider_start=motions.poses[0, k],
                slider_end=motions.poses[1, k],
                push_heading=float(motions.heading[k]),
                covariates=covariates,
            )
            found.append(window)
            self._edge, self._index = int(motions.edge[k]), self._index + 1
            self._slid += float(np.hypot(*window.displacement[:2]))
        return found

    def _keep_edge(self, motions: _Motions, k: int) -> None:
        """At a vertex the contact belongs to the edge it slid along, so to that of the window before."""
        outline, count = self._rig.outline, len(self._rig.outline.vertices)
        vertex = int(np.argmin(np.linalg.norm(outline.vertices - motions.touch.point[k], axis=1)))
        before = (vertex - 1) % count
        if self._edge in (before, vertex):
            motions.edge[k] = self._edge
            motions.contact[k] = outline.contact_on_edge(self._edge, 1.0 if self._edge == before else 0.0)
            row = slice(k, k + 1)
            motions.normal[row], motions.angle[row] = _angles(
                outline, motions.contact[row], motions.poses[0, row], motions.heading[row]
            )

    def _conditions(self, motions: _Motions, k: int, start: int, push: PushContext) -> dict[str, float]:
        """The covariates that follow from geometry and time."""
        x, y, heading = motions.poses[0, k].tolist()
        return {
            "push_heading": float(motions.heading[k]),
            "edge": float(motions.edge[k]),
            "contact_gap": float(motions.touch.distance[k] - self._rig.pusher_radius),
            "push_index": float(push.push_index),
            "dwell_time": push.dwell,
            "time_since_contact": (start - push.first_touch) * NANOSECOND,
            "slider_x": x,
            "slider_y": y,
            "slider_heading": float(wrap_angle(heading)),
        }


def pusher_motion(pusher: Track, begin: Array, end: Array) -> tuple[Array, Array]:
    """Positions (n, 2) m and velocities (n, 2) m/s at times (n,) s, by least-squares lines through the samples after.

    Each line takes those of FIT_SPAN, and at least FIT_SAMPLES, but none after `end` (n,) s. Where that leaves fewer
    than two, it joins the positions at both times.
    """
    first = np.searchsorted(pusher.time, begin)
    last = np.maximum(np.searchsorted(pusher.time, begin + FIT_SPAN, side="right"), first + FIT_SAMPLES)
    last = np.minimum(last, np.searchsorted(pusher.time, end, side="right"))
    few = last < first + 2
    position, velocity = np.empty((len(begin), 2)), np.empty((len(begin), 2))
    position[few] = pusher.at(begin[few])[:, :2]
    velocity[few] = (pusher.at(end[few])[:, :2] - position[few]) / (end - begin)[few, None]
    if not few.all():
        count, rows = (last - first)[~few], part_rows(first[~few], last[~few])
        time = pusher.time[rows] - np.repeat(begin[~few], count)
        position[~few], velocity[~few], _ = part_lines(time, pusher.values[rows, :2], count)
    return position, velocity


def _motions(outline: Outline, slider: Track, pusher: Track, times: Array) -> _Motions:
    """The motions between times (2, n) in s."""
    poses, tips = (track.at(times.ravel()).reshape(*times.shape, -1) for track in (slider, pusher))
    poses, tips = poses[..., [0, 1, 3]], tips[..., :2]
    position, velocity = pusher_motion(pusher, times[0], times[1])
    touch, heading = outline.project(to_body(position, poses[0])), np.arctan2(velocity[:, 1], velocity[:, 0])
    contact, edge = touch.contact, outline.edge(touch.contact)[0]
    normal, angle = _angles(outline, contact, poses[0], heading)
    moved = poses[1] - poses[0]
    displacement = np.column_stack([rotate(moved[:, :2], -heading), moved[:, 2]])
    return _Motions(poses, tips, np.hypot(*velocity.T), heading, touch, contact, edge, normal, angle, displacement)


def _angles(outline: Outline, contact: Array, poses: Array, heading: Array) -> tuple[Array, Array]:
    """Inward normals (n, 2) in the world at contacts (n,), and angles (n,) from them to headings (n,)."""
    normal = rotate(outline.inward_normal(contact), poses[:, 2])
    return normal, wrap_angle(heading - np.arctan2(normal[:, 1], normal[:, 0]))


def _faults(rig: Rig, motions: _Motions) -> list[str]:
    """The fault of each motion that no push explains, empty without one."""
    driven, moved = (np.hypot(*(of[1] - of[0])[:, :2].T) for of in (motions.tips, motions.poses))
    before, after = (rig.outline.project(to_body(motions.tips[k], motions.poses[k])).distance for k in (0, 1))
    entered = before - after > np.maximum(ENTERED, ENTERED_SHARE * driven)
    outran = moved > OUTRAN + OUTRAN_SHARE * driven
    return list(np.where(entered, "left_behind", np.where(outran, "outran", "")))


def _forces(wrench: Track, times: Array) -> Array:
    """Mean forces (n, 2) N on the pusher between times (2, n) s, NaN without a sample."""
    found = np.full((times.shape[1], 2), np.nan)
    begin, end = np.searchsorted(wrench.time, times[0]), np.searchsorted(wrench.time, times[1], side="right")
    if (some := end > begin).any():
        found[some] = part_means(wrench.values[part_rows(begin[some], end[some]), :2], (end - begin)[some])
    return found


def _on_slider(force: Array, tare: tuple[float, float] | None, normal: Array) -> dict[str, float]:
    """The force (2,) N on the slider: along the inward normal (2,), and to its left; empty if it is unknown.

    tare: what the sensor reads without contact; it is subtracted, and kept to judge the sensor's bias.
    """
    zero = {} if tare is None else {"free_force_x": tare[0], "free_force_y": tare[1]}
    if np.isnan(force[0]):
        return zero
    x, y = tare or (0.0, 0.0)
    x, y = x - float(force[0]), y - float(force[1])  # the wrench is the force of the slider on the pusher
    along_x, along_y = normal.tolist()
    return {"normal_force": x * along_x + y * along_y, "tangential_force": y * along_x - x * along_y, **zero}
