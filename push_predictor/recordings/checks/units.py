# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Units, signs and orders of numbers: mm, degrees, ms, w first, a frame that is not upright; signs of a push table.

Quasi-static mechanics decides the signs for any pressure and friction. The force of a tip whose velocity is outside the
friction cone lies between the normal and the velocity. The slider's centre follows the force: dy has the sign of minus
the angle. The slider turns as the force turns it. Inside the cone it turns as two of three lines do, the cone's edges
and the velocity (the voting theorem of Mason, 1986). Only rows in which all lines agree are judged.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from push_predictor.geometry.frames import rotate, wrap_angle
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.dropouts import usual_interval
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

FASTEST = 2.0  # m/s of a pusher
LARGEST = 2.0  # m: reach of a slider
HIGHEST_RATE = 20e3  # Hz of samples
LOWEST_RATE = 1.0  # Hz
SPEED_SPAN = 0.1  # s between the poses whose speed is judged
PUSHER_MM = "Give positions in metres: divide by 1000."
STILL = 1e-5  # rad; a tracker's noise is larger
STEEP = np.radians(45.0)  # a slider lies flat, while w read as x rolls it by pi minus its heading
OVERTURNED = np.pi - STEEP  # from here on the z axis points down
FROZEN = 0.2  # rad; w read as x leaves a heading of about twice the true tilt
COVERED = 95.0  # percentile: few samples may be tracked wrongly
TRAVEL = 0.02  # m of a slider that also turns
OUTRUN = 5.0  # path lengths; a slider does not turn by more of its own reach
TURN_SPAN = 0.05  # s between the poses whose turns are summed
LONGEST = 30.0  # s of a row
CONE, NARROW = np.radians(25.0), np.radians(3.0)  # half angles of friction cones: coefficients of 0.47 and 0.05
FEWEST = 10  # rows
WRONG = -0.5  # agreement below which the sign is wrong; it is from -1 to 1, and near 1 in sound data
FRAMES = "Give dy to the left of the push, angles and contacts counter-clockwise, seen from above."


def stream_rates(recording: Recording) -> list[Finding]:
    """Findings about the unit of the stamps."""
    found = [_rate(name, stream) for name, stream in recording.poses.items() if len(stream) > 2]
    return [finding for finding in found if finding is not None]


def stream_units(recording: Recording, rig: Rig) -> list[Finding]:
    """Findings about the units of lengths and angles of a recording's streams and rig."""
    found = [_rig_length(rig), *(_speed(name, of) for name, of in recording.poses.items() if len(of) > 2)]
    if not any(found) and tilt_of(recording.slider) <= STEEP:  # of a steep z axis, headings may be anything
        found.append(_turning(recording.slider, rig))
    return [finding for finding in found if finding is not None]


def _rig_length(rig: Rig) -> Finding | None:
    size = rig.outline.reach
    if max(size, rig.pusher_radius) < LARGEST:
        return None
    sentence = f"The rig's outline reaches {size:.4g} m, the tip radius is {rig.pusher_radius:.4g} m: probably mm."
    return Finding("units_rig", "refused", sentence, "Give the rig's lengths in metres.", {"reach": Value(size, "m")})


def _rate(name: str, stream: PoseStream) -> Finding | None:
    if not (usual := usual_interval(stream.stamp)) or LOWEST_RATE <= (rate := 1.0 / usual) <= HIGHEST_RATE:
        return None
    sentence = f"The {name}'s stamps give {rate:.3g} samples a second: the unit of the stamps is probably ms or us."
    advice = "Give stamps in seconds and nanoseconds."
    return Finding(f"units_time_{name}", "refused", sentence, advice, {"rate": Value(rate, "Hz")})


def _speed(name: str, stream: PoseStream) -> Finding | None:
    """Of the steps that contain half of the path: a few tracking errors, or long rests, do not matter.

    Steps of SPEED_SPAN: between two samples, stamps of receipt and poses of a slower source show no speed.
    """
    rows = every(stream, SPEED_SPAN)
    step, time = np.hypot(np.diff(stream.x[rows]), np.diff(stream.y[rows])), 1e-9 * np.diff(stream.stamp[rows])
    known = np.isfinite(step) & (time > 0.0)
    if not known.any():
        return None
    speed = _weighted_median(step[known] / time[known], step[known])
    if speed <= FASTEST:
        return None
    sentence = f"The {name} moves at {speed:.3g} m/s, more than {FASTEST:.0f} m/s: its positions are probably in mm."
    return Finding(f"units_length_{name}", "refused", sentence, PUSHER_MM, {"speed": Value(speed, "m/s")})


def _turning(slider: PoseStream, rig: Rig) -> Finding | None:
    """A finding if the slider turns farther than a pushed one."""
    turn, path = turn_and_path(slider)
    if turn * rig.outline.reach <= OUTRUN * max(path, TRAVEL):
        return None
    sentence = f"The slider turns by {turn:.0f} rad over {path:.2f} m: its heading is probably in degrees."
    return Finding("units_heading", "refused", sentence, "Give headings in radians.", {"turn": Value(turn, "rad")})


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


# --- orientations: w first, not recorded, or of a tracked frame whose z axis is not up --------------------------------


def orientation_finding(slider: PoseStream, rig: Rig) -> Finding | None:
    """A finding if the orientations of a slider that moves have another order of components, or are missing.

    The z axis of its tracked frame may point down or sideways, as long as its x axis shows the heading.
    """
    x, y = slider.x[np.isfinite(slider.x)], slider.y[np.isfinite(slider.y)]
    if not (len(x) and len(y)) or np.hypot(np.ptp(x), np.ptp(y)) < TRAVEL:
        return None
    tilt, largest = tilt_of(slider), float(np.nanmax(np.abs(slider.heading)))
    if tilt > STEEP:
        return _tilted(slider, rig, tilt)
    if largest > STILL:
        return None
    sentence = "The slider moves and its heading is exactly 0 throughout: its orientation is probably not recorded."
    return Finding("heading_constant", "refused", sentence, "Record the orientation of the slider.")


def tilt_of(slider: PoseStream) -> float:
    """The tilt (rad) that few samples exceed. The median would be small for w first and headings near pi."""
    return 0.0 if slider.tilt is None or not len(slider.tilt) else float(np.nanpercentile(slider.tilt, COVERED))


def has_heading(slider: PoseStream) -> bool:
    """Whether the z axis is near the vertical, up or down: with it level, the x axis may be vertical."""
    return not STEEP < tilt_of(slider) < OVERTURNED


def turn_and_path(slider: PoseStream) -> tuple[float, float]:
    """How far the slider turns (rad) and moves (m) in all; a pushed one turns about as far, in terms of its size."""
    usable = np.isfinite(slider.x + slider.y + slider.heading)
    pose = np.column_stack([slider.x, slider.y, slider.heading])[usable]
    step = np.diff(pose[every(slider, TURN_SPAN)], axis=0)
    return float(np.sum(np.abs(wrap_angle(step[:, 2])))), float(np.sum(np.hypot(*step[:, :2].T)))


def every(stream: PoseStream, span: float) -> slice:
    """Samples about `span` s apart."""
    return slice(None, None, max(1, round(span / max(usual_interval(stream.stamp) or span, 1e-6))))


def _tilted(slider: PoseStream, rig: Rig, tilt: float) -> Finding:
    values = {"tilt": Value(tilt, "rad")}
    up = f"The slider's z axis is {np.degrees(tilt):.0f} degrees from the vertical"
    if float(np.nanpercentile(np.abs(slider.heading), COVERED)) < FROZEN:
        sentence = f"{up} and its heading does not change: the quaternion's order is probably w, x, y, z."
        return Finding("quaternion_order", "refused", sentence, "Give orientations as x, y, z, w.", values)
    turn, path = turn_and_path(slider)
    if turn * rig.outline.reach > OUTRUN * max(path, TRAVEL):
        sentence = f"{up}, and its x axis too is near the vertical: its heading is unknown."
        return Finding("slider_tilted", "refused", sentence, "Give a tracked frame whose z axis points up.", values)
    where = "points down" if tilt > OVERTURNED else "is level"
    sentence = f"{up}: it {where}. The heading is that of the x axis, seen from above."
    advice = "Give the outline as seen from above, y to the left of x, or a tracked frame whose z axis points up."
    return Finding("slider_tilted", "warning", sentence, advice, values)


# --- push tables: units, and the signs of dy and dtheta ---------------------------------------------------------------


class Agreement(NamedTuple):
    """The sum of a column with the signs that mechanics expects, over that of its absolute values; rows: how many."""

    share: float
    rows: int

    @property
    def wrong(self) -> bool:
        """Whether the sign is wrong, in enough rows."""
        return self.rows >= FEWEST and self.share < WRONG


def check_table(table: PushTable, rig: Rig | None = None) -> tuple[Finding, ...]:
    """The probable mistakes of a push table, none if it is sound."""
    return tuple(table_units(table, rig) or table_signs(table, rig))


def table_units(table: PushTable, rig: Rig | None = None) -> list[Finding]:
    """Findings about the units of a table's columns."""
    velocity, path = table.inputs[:, 0], table.inputs[:, 0] * table.duration
    shift, turn = np.hypot(table.outcomes[:, 0], table.outcomes[:, 1]), np.abs(table.outcomes[:, 2])
    found = [] if rig is None else [_rig_length(rig)]
    if len(table):
        found += [
            _column("velocity", "mm/s", np.median(velocity), FASTEST, "m/s"),
            _column("duration", "ms", np.median(table.duration), LONGEST, "s"),
            _column("dtheta", "degrees", np.percentile(turn, 99.0), np.pi, "rad"),
        ]
        if not any(found):
            ratio = float(np.median(shift / np.maximum(path, 1e-9)))
            found.append(_column("dx and dy", "mm", ratio, OUTRUN, "path lengths of the tip"))
    return [finding for finding in found if finding is not None]


def _column(name: str, unit: str, value: float, most: float, of: str) -> Finding | None:
    if value <= most:
        return None
    sentence = f"{name} reaches {value:.4g} {of}, more than {most:.3g}: the unit is probably {unit}."
    return Finding(
        f"units_{name.split()[0]}", "refused", sentence, "Give m, rad and s.", {name: Value(float(value), of)}
    )


def table_signs(table: PushTable, rig: Rig | None = None) -> list[Finding]:
    """Findings about the signs of dy, and with a rig of dtheta."""
    angle = table.inputs[:, 2]
    dy = _agreement(table.outcomes[:, 1], np.where(np.abs(angle) > CONE, -np.sign(angle), 0.0))
    turn = Agreement(0.0, 0) if rig is None else _agreement(table.outcomes[:, 2], _turning_signs(table, rig))
    if dy.wrong and turn.wrong:
        return [_finding("table_mirrored", "dy and dtheta have the wrong sign", {"dy": dy, "dtheta": turn})]
    if dy.wrong:
        return [_finding("dy_sign", "dy, or the angle, has the wrong sign", {"dy": dy})]
    if turn.wrong:
        return [_finding("dtheta_sign", "dtheta has the wrong sign, or contacts are clockwise", {"dtheta": turn})]
    return []


def _agreement(column: Array, expected: Array) -> Agreement:
    """Expected (n,): 1, -1, or 0 where mechanics does not decide."""
    judged = expected != 0.0
    size = float(np.sum(np.abs(column[judged])))
    share = float(np.sum(column[judged] * expected[judged])) / size if size > 0.0 else 0.0
    return Agreement(share, int(np.sum(judged)))


def _turning_signs(table: PushTable, rig: Rig) -> Array:
    """The sign (n,) of the rotation where the three lines agree, else 0."""
    contact, angle = table.inputs[:, 1], table.inputs[:, 2]
    arm, normal = rig.outline.point(contact) - rig.outline.centroid, rig.outline.inward_normal(contact)
    sliding, side = np.abs(angle) > CONE, np.sign(angle)
    edges = np.where(sliding, side * NARROW, -CONE), np.where(sliding, side * CONE, CONE)
    lines = [rotate(normal, turn) for turn in (*edges, angle)]
    moments = [np.sign(arm[:, 0] * line[:, 1] - arm[:, 1] * line[:, 0]) for line in lines]
    return np.asarray(np.where((moments[0] == moments[1]) & (moments[1] == moments[2]), moments[0], 0.0))


def _finding(name: str, what: str, agreements: dict[str, Agreement]) -> Finding:
    shares = " and ".join(f"{each.share:.2f}" for each in agreements.values())
    sentence = f"The table's {what}: agreement with mechanics {shares}, from -1 to 1."
    values = {column: Value(each.share, "1") for column, each in agreements.items()}
    return Finding(name, "warning", sentence, FRAMES, values)
