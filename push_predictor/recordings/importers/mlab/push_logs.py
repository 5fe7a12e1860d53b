# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Import of the MLab push logs (Zhou, Paolini, Bagnell, Mason, ICRA 2016): a table, one row per push.

A log has the object's pose only before and after a push, so a push is one row. The contact is where the path of the
finger meets the outline; duration and velocity are those of the path from there on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from push_predictor.errors import ImportSourceError
from push_predictor.geometry.frames import rotate, to_body, to_world, wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.recordings.importers.cleaning import twist
from push_predictor.recordings.importers.mlab.force import contact_force
from push_predictor.recordings.importers.mlab.log_parser import LogPush, read_log, report_irregularities
from push_predictor.recordings.importers.mlab.rig import CENTROID, folder_rig
from push_predictor.recordings.importers.report import ImportReport, Notes
from push_predictor.recordings.importers.staging import Staging, safe_name
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

MILLIMETRE = 1e-3
FEWEST_POSES = 4
ASSUMED = (
    "contact begins where the tip's straight path meets the outline at rest, and ends when the tip stops. Velocity "
    "times duration is the distance travelled in contact",
    "the force in the world is R(tool yaw) T (F - mean of the first 10 samples), where T is a reflection (MLab_EXP, "
    "ExtractFromLog.m). It is averaged over the second half of a push",
)


@dataclass(frozen=True, eq=False)
class PushRow:
    """One push as a row of a table; slider (3,) is the pose of the centroid before the push."""

    velocity: float
    edge: int
    contact: float
    angle: float
    duration: float
    outcome: Array
    slider: Array
    heading: float
    normal_force: float
    tangential_force: float


class NotAPushError(Exception):
    """A logged push that cannot become a row; the text states why."""


def import_mlab(sources: Sequence[Path], staging: Staging, rig: Rig | None = None) -> ImportReport:
    """NAME.csv and NAME.rig.yaml for each log, NAME = FOLDER_LOG.

    Raises ImportSourceError with file and line.
    """
    notes = Notes(assumed=list(ASSUMED))
    for path in staging.in_turn(_logs(sources)):
        name = safe_name(f"{path.parent.name}_{path.name.split('.')[0]}")
        used = rig or folder_rig(path.parent.name, notes)
        table = read_mlab(path, name, used, notes)
        if len(table):
            staging.table(name, table, used)
    if not staging.written:
        raise ImportSourceError(
            f"{', '.join(map(str, sources))}: contains no usable push; {'; '.join(notes.dropped)[:300]}"
        )
    return staging.report("mlab", notes)


def read_mlab(path: Path, name: str, rig: Rig, notes: Notes) -> PushTable:
    """The pushes of one log; pushes that cannot become rows are reported in notes."""
    rows: list[tuple[LogPush, PushRow]] = []
    pushes = read_log(path, notes)
    for push in pushes:
        try:
            rows.append((push, push_row(push, rig.outline)))
        except NotAPushError as reason:
            notes.dropped.append(f"{path}:{push.line}: push {push.number}: {reason}")
    report_irregularities(path, pushes, notes)
    found = [row for _, row in rows]
    return PushTable(
        np.array([[row.velocity, row.contact, row.angle] for row in found]).reshape(-1, 3),
        np.array([row.duration for row in found]),
        np.array([row.outcome for row in found]).reshape(-1, 3),
        np.array([f"{name}/{push.number}" for push, _ in rows], dtype=np.str_),
        _covariates(rows),
    )


def _covariates(rows: list[tuple[LogPush, PushRow]]) -> dict[str, Array]:
    start = min((push.time for push, _ in rows), default=0.0)
    columns: dict[str, list[float]] = {
        "elapsed_time": [push.time - start for push, _ in rows],
        "push_index": [float(push.number) for push, _ in rows],
        "slider_x": [float(row.slider[0]) for _, row in rows],
        "slider_y": [float(row.slider[1]) for _, row in rows],
        "slider_heading": [float(wrap_angle(row.slider[2])) for _, row in rows],
        "push_heading": [row.heading for _, row in rows],
        "edge": [float(row.edge) for _, row in rows],
        "normal_force": [row.normal_force for _, row in rows],
        "tangential_force": [row.tangential_force for _, row in rows],
    }
    return {name: np.array(column) for name, column in columns.items()}


def push_row(push: LogPush, outline: Outline) -> PushRow:
    """One push as a row. Raises NotAPushError."""
    if len(push.robot) < FEWEST_POSES:
        raise NotAPushError(f"{len(push.robot)} robot poses, at least {FEWEST_POSES} are needed")
    before, after = centroid_pose(push.before), centroid_pose(push.after)
    tip = push.robot[:, 1:3] * MILLIMETRE
    path = tip[-1] - tip[0]
    travel = float(np.hypot(*path))
    if travel == 0.0:
        raise NotAPushError("the tip does not move")
    heading = float(np.arctan2(path[1], path[0]))
    edge, fraction, reach = first_touch(outline, to_body(tip[0], before), rotate(path / travel, -before[2]))
    if reach >= travel:
        raise NotAPushError(f"the tip moves {travel * 1e3:.1f} mm, the outline is {reach * 1e3:.1f} mm away")
    duration = _contact_time(push.robot[:, 0], (tip - tip[0]) @ path / travel, reach)
    contact = float(outline.contact_on_edge(edge, fraction))
    normal = rotate(outline.inward_normal(np.array([contact]))[0], before[2])
    force = contact_force(push.force, push.robot)
    return PushRow(
        velocity=(travel - reach) / duration,
        edge=edge,
        contact=contact,
        angle=float(wrap_angle(heading - np.arctan2(normal[1], normal[0]))),
        duration=duration,
        outcome=np.append(rotate(after[:2] - before[:2], -np.array(heading)), wrap_angle(after[2] - before[2])),
        slider=before,
        heading=heading,
        normal_force=float(force @ normal),
        tangential_force=float(force @ [-normal[1], normal[0]]),
    )


def centroid_pose(logged: Array) -> Array:
    """Pose (3,) m, rad of the triangle's centroid from a logged pose (7,) of its right angle, mm."""
    corner = np.array([*logged[:2] * MILLIMETRE, twist(logged[6], logged[3])])
    return np.append(to_world(CENTROID, corner), corner[2])


def first_touch(outline: Outline, tip: Array, direction: Array) -> tuple[int, float, float]:
    """Where a tip (2,) that moves along a unit vector (2,) enters the polygon.

    Returns the edge, the fraction along it and the distance in m. Raises NotAPushError if the tip never enters.
    """
    starts = outline.vertices
    along = np.roll(starts, -1, axis=0) - starts
    offset = starts - tip
    cross = direction[0] * along[:, 1] - direction[1] * along[:, 0]  # negative where the path enters
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        reach = (offset[:, 0] * along[:, 1] - offset[:, 1] * along[:, 0]) / cross
        fraction = (offset[:, 0] * direction[1] - offset[:, 1] * direction[0]) / cross
    enters = np.flatnonzero((cross < 0.0) & (reach > 0.0) & (fraction >= 0.0) & (fraction <= 1.0))
    if not len(enters):
        raise NotAPushError("the tip's path does not meet the outline from outside")
    edge = int(enters[np.argmin(reach[enters])])
    return edge, float(fraction[edge]), float(reach[edge])


def _contact_time(time: Array, travelled: Array, reach: float) -> float:
    """Seconds from the first touch to the last logged motion of the tip; repeated poses are removed."""
    fresh = np.concatenate([[True], np.diff(travelled) != 0.0])
    time, travelled = time[fresh], travelled[fresh]
    last = int(np.flatnonzero(travelled < reach)[-1])
    share = (reach - travelled[last]) / (travelled[last + 1] - travelled[last])
    duration = float(time[-1] - (time[last] + share * (time[last + 1] - time[last])))
    if not duration > 0.0:
        raise NotAPushError("the robot's stamps do not increase")
    return duration


def _logs(sources: Sequence[Path]) -> list[Path]:
    found = []
    for source in sources:
        if not source.exists():
            raise ImportSourceError(f"{source}: does not exist, give a log or a folder of exp*.txt[.gz]")
        inside = sorted({*source.rglob("exp*.txt"), *source.rglob("exp*.txt.gz")}) if source.is_dir() else [source]
        if not inside:
            raise ImportSourceError(f"{source}: contains no exp*.txt or exp*.txt.gz")
        found += inside
    return found
