# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Import of the MLab push logs (Zhou, Paolini, Bagnell, Mason, ICRA 2016): a table, one row per push.

A log is the number of pushes, then for each push: object pose before, object pose after (x y z qw qx qy qz), the
number of forces, that many lines `t fx fy`, the number of robot poses, that many lines `t x y z qw qx qy qz`; lengths
in mm. A log has the object's pose only before and after a push, so a push is one row. The contact is where the path of
the finger meets the outline; duration and velocity are those of the path from there on.
"""

from __future__ import annotations

import gzip
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from push_predictor.errors import ImportSourceError
from push_predictor.geometry.frames import rotate, to_body, to_world, wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.recordings.importers.cleaning import twist
from push_predictor.recordings.importers.staging import ImportReport, Notes, Staging, safe_name, sources_in
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
MOVED_BY_HAND = 1.0  # mm between two pushes
POSE_WIDTH, FORCE_WIDTH, ROBOT_WIDTH = 7, 3, 8
SENSOR_TO_TOOL = np.array([[1.0, 1.0], [1.0, -1.0]]) / np.sqrt(2.0)  # seen from below: a reflection
TARE_SAMPLES = 10
LEG = 0.150  # m
CENTROID = np.array([0.050, 0.050])  # m from the right angle
MASS = 1.518  # kg
FINGER_RADIUS = 1e-4  # m; a pointed finger: at the end of a push the logged tip lies on the edge
SURFACES = {"": "hardboard", "wood_": "plywood"}
THREE_POINTS = re.compile(r"(wood_)?((?:\d+(?:\.\d+)?_){5}\d+(?:\.\d+)?)")
PATCH = re.compile(r"(wood_)?patch")
FINGER = f"the finger is pointed: pusher radius {FINGER_RADIUS} m, contact where the tip's path meets the outline"
ROUND_TRIP = "the object is the aluminium triangle of 1.518 kg with legs of 150 mm, its centre at (50, 50) mm"


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
    for path in staging.in_turn(sources_in(sources, "exp*.txt", "exp*.txt.gz")):
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


@dataclass(frozen=True, eq=False)
class LogPush:
    """One push: number in the log, from 0; line; before, after (7,); force (n, 3); robot (m, 8)."""

    number: int
    line: int
    before: Array
    after: Array
    force: Array
    robot: Array

    @property
    def time(self) -> float:
        """Start of the push: Unix seconds of the first force, else of the first robot pose."""
        return float((self.force if len(self.force) else self.robot)[0, 0])


class _EndedError(Exception):
    """The file ends within a push."""


class _Lines:
    """The lines of a log as numbers, with their line numbers."""

    def __init__(self, path: Path) -> None:
        self.path = path
        lines = enumerate(_text(path).splitlines(), start=1)
        self.lines = [(number, line.split()) for number, line in lines if line.strip()]
        self.next = 0

    def __bool__(self) -> bool:
        return self.next < len(self.lines)

    def line(self) -> int:
        return self.lines[min(self.next, len(self.lines) - 1)][0]

    def table(self, width: int, what: str, count: int) -> Array:
        """The next `count` lines as numbers (count, width). Raises ImportSourceError that names a wrong line."""
        rows = self.lines[self.next : self.next + count]
        if len(rows) < count:
            raise _EndedError
        values = _numbers([words for _, words in rows], width)
        if values is None:
            number, words = next(row for row in rows if _numbers([row[1]], width) is None)
            wanted = f"{what}: {width} finite number{'s' if width > 1 else ''}"
            raise ImportSourceError(f"{self.path}:{number}: {' '.join(words)[:60]!r}, expected {wanted}")
        self.next += count
        return values

    def row(self, width: int, what: str) -> Array:
        return np.asarray(self.table(width, what, 1)[0])

    def count(self, what: str) -> int:
        number, value = self.line(), float(self.row(1, what)[0])
        if value < 0 or value != int(value):
            raise ImportSourceError(f"{self.path}:{number}: {value!r}, expected {what}: a whole number, 0 or above")
        return int(value)


def _numbers(rows: list[list[str]], width: int) -> Array | None:
    """The rows (n, width) as numbers, None unless all are finite."""
    try:
        values = np.array(rows, dtype=np.float64).reshape(len(rows), width)
    except ValueError:
        return None
    return values if np.all(np.isfinite(values)) else None


def read_log(path: Path, notes: Notes) -> list[LogPush]:
    """The complete pushes of a log. Raises ImportSourceError with file and line."""
    lines = _Lines(path)
    if not lines:
        raise ImportSourceError(f"{path}: is empty, expected a push log")
    stated, pushes = None, list[LogPush]()
    if len(lines.lines[0][1]) == POSE_WIDTH:
        notes.repaired.append(f"{path}:{lines.line()}: the number of pushes is missing; read to the end of the file")
    else:
        stated = lines.count("the number of pushes")
    while lines:
        first = lines.line()
        try:
            pushes.append(_push(lines, len(pushes), first))
        except _EndedError:
            notes.dropped.append(f"{path}:{first}: push {len(pushes)} is cut off by the end of the file")
            break
    if stated is not None and stated != len(pushes):
        notes.repaired.append(f"{path}:1: states {stated} pushes, contains {len(pushes)}")
    return pushes


def report_irregularities(path: Path, pushes: list[LogPush], notes: Notes) -> None:
    """Note missing forces, repeated poses, a clock set back and objects moved by hand in a log."""
    if bare := [push.number for push in pushes if not len(push.force)]:
        notes.dropped.append(f"{path}: {len(bare)} pushes without forces; normal_force and tangential_force are empty")
    repeats = sum(int(np.sum(np.all(np.diff(push.robot[:, 1:], axis=0) == 0.0, axis=1))) for push in pushes)
    if repeats:
        notes.repaired.append(f"{path}: {repeats} robot poses repeat the one before, ignored in the contact time")
    timed = [push for push in pushes if len(push.force) or len(push.robot)]
    for one, two in pairwise(timed):
        if (back := one.time - two.time) > 0.0:
            notes.repaired.append(
                f"{path}:{two.line}: after push {one.number} the clock goes back by {back:.0f} s, so the log "
                "joins two sessions; elapsed_time counts from the earliest stamp"
            )
            continue
        moved = float(np.hypot(*(two.before - one.after)[:2]))
        if moved > MOVED_BY_HAND:
            notes.assume(f"{path}:{two.line}: the object was moved by hand {moved:.1f} mm before push {two.number}")


def _push(lines: _Lines, number: int, first: int) -> LogPush:
    before = lines.row(POSE_WIDTH, "the object's pose before the push")
    after = lines.row(POSE_WIDTH, "the object's pose after the push")
    force = lines.table(FORCE_WIDTH, "force", lines.count("the number of forces"))
    robot = lines.table(ROBOT_WIDTH, "robot pose", lines.count("the number of robot poses"))
    return LogPush(number, first, before, after, force, robot)


def _text(path: Path) -> str:
    try:
        data = path.read_bytes()
        return (gzip.decompress(data) if path.suffix == ".gz" else data).decode("ascii")
    except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
        raise ImportSourceError(f"{path}: cannot be read ({error})") from None


def contact_force(force: Array, robot: Array) -> Array:
    """Mean force (2,) N of the finger on the object in the world in the second half of a push, NaN if unknown.

    force: (n, 3) of t, fx, fy as logged, in the axes of the sensor. robot: (m, 8)
    of t, x, y, z, qw, qx, qy, qz. Source: MLab_EXP, ExtractFromLog.m.
    """
    if len(force) <= 2 * TARE_SAMPLES:
        return np.full(2, np.nan)
    return np.asarray(force_samples(force, robot)[len(force) // 2 :].mean(axis=0))


def force_samples(force: Array, robot: Array) -> Array:
    """Force (n, 2) N of the finger on the object in the world, relative to the first samples; as `contact_force`."""
    qw, _, _, qz = np.median(robot[:, 4:], axis=0)
    pressed = force[:, 1:] - force[:TARE_SAMPLES, 1:].mean(axis=0)
    return rotate(-pressed @ SENSOR_TO_TOOL.T, twist(qz, qw))


def triangle() -> Outline:
    """The triangle about its centroid.

    Edge 0 goes from the right angle along +x, edge 1 is the hypotenuse.
    """
    return Outline(np.array([[0.0, 0.0], [LEG, 0.0], [0.0, LEG]]) - CENTROID)


def folder_rig(folder: str, notes: Notes) -> Rig:
    """The rig from a log's folder name: [wood_]x1_x2_x3_y1_y2_y3 (mm) or [wood_]patch."""
    notes.assume(ROUND_TRIP)
    notes.assume(FINGER)
    if match := THREE_POINTS.fullmatch(folder):
        points = np.array([float(word) for word in match[2].split("_")]).reshape(2, 3).T / 1000.0 - CENTROID
        notes.assume(f"{folder}: the support points follow from the folder's name, their loads from the centre of mass")
        return _rig(SURFACES[match[1] or ""], np.column_stack([points, load_shares(points)]))
    if match := PATCH.fullmatch(folder):
        return _rig(SURFACES[match[1] or ""], None)
    notes.assume(
        f"{folder or 'log'}: the folder's name contains no configuration; surface and support points are unknown"
    )
    return _rig("unknown", None)


def load_shares(points: Array) -> Array:
    """Load shares (3,) of three points (3, 2) about the centre of mass."""
    return np.asarray(np.linalg.solve(np.vstack([points.T, np.ones(3)]), [0.0, 0.0, 1.0]))


def _rig(surface: str, support: Array | None) -> Rig:
    return Rig("triangle", triangle(), FINGER_RADIUS, surface, MASS, support)
