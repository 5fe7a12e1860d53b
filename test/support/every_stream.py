# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One push in every accepted type: poses, wrenches and scalars of a laboratory, in each frame and along each axes.

Some messages cannot be read. What has no header has the stamp as its log time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from lab_bags import LATENCY, Lab, Message, assign, pose_rows, pose_values, zeros
from synthetic import Push, moved, translating_push
from turning_sensor import MOUNT, in_sensor_axes, measured_at, wrench_rows

from push_predictor.recordings.fields.pose_rows import composed, in_world_axes, inverted, normalised, turned
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording, WrenchStream
from push_predictor.recordings.topics import Topics
from push_predictor.types import Array, IntArray

SECOND = 10**9
HEADER = "std_msgs/Header header\n"
BODY = "lab_msgs/msg/Body"
OWN = {
    "lab_msgs/msg/State": "string[] notes\nOdom odom\ngeometry_msgs/Wrench ft\n",
    "lab_msgs/msg/Odom": f"{HEADER}float64 age\ngeometry_msgs/PoseStamped pose\n",
    "lab_msgs/msg/Matrices": f"{HEADER}float64[16] full\nfloat32[12] top\nfloat64[3] place\nfloat64[9] turn\n",
    "lab_msgs/msg/Parts": f"{HEADER}geometry_msgs/Quaternion turn\ngeometry_msgs/Point place\n",
    "lab_msgs/msg/Bodies": f"{HEADER}Body[] bodies\n",
    BODY: "string name\nint32 id\ngeometry_msgs/Pose pose\n",
    "lab_msgs/msg/ForceTorque": f"{HEADER}geometry_msgs/Vector3 twist\ngeometry_msgs/Vector3 push\n",
    "lab_msgs/msg/Counts": "int32[4] values\n",
}
# {how a pose is given: (type, where in it, the field that is named)}; `tf` is a frame.
TYPES = {
    "stamped": ("geometry_msgs/msg/PoseStamped", "pose", ""),
    "transform": ("geometry_msgs/msg/TransformStamped", "transform", ""),
    "odometry": ("nav_msgs/msg/Odometry", "pose.pose", ""),
    "covariance": ("geometry_msgs/msg/PoseWithCovarianceStamped", "pose.pose", ""),
    "field": ("lab_msgs/msg/State", "odom.pose.pose", "odom.pose.pose"),
    "plain": ("geometry_msgs/msg/Pose", "", ""),
    "plain transform": ("geometry_msgs/msg/Transform", "", ""),
    "square": ("lab_msgs/msg/Matrices", "", "full"),
    "flat": ("lab_msgs/msg/Matrices", "", "top"),
    "rotation": ("lab_msgs/msg/Matrices", "", "place+turn"),
    "parts": ("lab_msgs/msg/Parts", "", "turn+place"),
    "named": ("lab_msgs/msg/Bodies", "", "bodies[block].pose"),
    "numbered": ("lab_msgs/msg/Bodies", "", "bodies[id=7].pose"),
}
KINDS = (*TYPES, "tf")
WRENCHES = {
    "stamped": ("geometry_msgs/msg/WrenchStamped", ("wrench.force", "wrench.torque"), ""),
    "plain": ("geometry_msgs/msg/Wrench", ("force", "torque"), ""),
    "field": ("lab_msgs/msg/State", ("ft.force", "ft.torque"), "ft"),
    "sum": ("lab_msgs/msg/ForceTorque", ("push", "twist"), "push+twist"),
    "biased": ("geometry_msgs/msg/WrenchStamped", ("wrench.force", "wrench.torque"), ""),
}
BIAS = np.array([0.7, -0.4, 0.3, 0.02, 0.01, 0.05])  # N, N m: of `biased`, along each axes
SCALARS = {
    "/float64": ("std_msgs/msg/Float64", "data"),
    "/float32": ("std_msgs/msg/Float32", "data"),
    "/temperature": ("sensor_msgs/msg/Temperature", "temperature"),
    "/humidity": ("sensor_msgs/msg/RelativeHumidity", "relative_humidity"),
    "/pressure": ("sensor_msgs/msg/FluidPressure", "fluid_pressure"),
}
COUNTS, AGE, NUMBER = "/counts.values[2]", "/ft/field/world.odom.age", "/slider/named/world.bodies[block].id"
FRAMES = {"slider": "cart", "pusher": "bench"}  # that headers name where a world is given
BENCH = normalised(np.array([[0.3, -0.2, 0.1, 0.1, 0.0, 0.6, 0.8]]))
# The turn of a world whose y axis is up, so that z is: y up about x.
TURNS = {"": [0.0, 0.0, 0.0, 1.0], "y": [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]}


@cache
def original() -> Recording:
    """A push of 1.2 s, between motion without contact."""
    push = translating_push(Push(1.5, 2.7), rate=40.0)
    return moved(push, np.array([0.3, -0.1]), 0.7)


def rig() -> Rig:
    found = original().rig
    assert found is not None
    return found


def wrench() -> WrenchStream:
    found = original().wrench
    assert found is not None
    return found


def cart_at(stamp: IntArray) -> Array:
    """Poses (n, 7) of the cart in the world: it moves and turns."""
    seconds = 1e-9 * (stamp - original().slider.stamp[0])
    none = np.zeros(len(stamp))
    columns = [0.05 * seconds, 0.2 + none, none, none, none, np.sin(0.1 * seconds), np.cos(0.1 * seconds)]
    return np.column_stack(columns)


@cache
def laboratory(up: str = "", back: int = 0) -> Lab:
    """Every pose as every type, in the world and in another frame; tf; wrenches along each axes; scalars.

    up: the axis of the world that points up, '' for z. back: by how much (ns) the clock of all headers is set back in
    the middle of the push.
    """
    builder = _Builder(up, back)
    lab, slider, pusher = builder.lab, original().slider, original().pusher
    late, early = np.arange(slider.stamp[4], slider.stamp[-9], SECOND // 30), pusher.stamp[:1]
    bench = np.repeat(BENCH, len(pusher), axis=0)
    in_frames = {
        "slider": composed(inverted(cart_at(slider.stamp)), pose_rows(slider)),
        "pusher": composed(inverted(bench), pose_rows(pusher)),
    }
    for name, stream in (("slider", slider), ("pusher", pusher)):
        rows = builder.in_world(pose_rows(stream))
        for how in TYPES:
            topic = f"/{name}/{how.replace(' ', '_')}"
            builder.poses(f"{topic}/world", how, "world", stream.stamp, rows)
            # What names no frame is in the world.
            other = (in_frames[name], FRAMES[name]) if not how.startswith("plain") else (rows, "")
            builder.poses(f"{topic}/other", how, other[1], stream.stamp, other[0])
    builder.transform("/tf_static", "world", "bench", early, builder.in_world(BENCH))
    builder.transform("/tf_static", "tool0", "sensor", early, MOUNT)
    builder.transform("/tf", "world", "cart", late, builder.in_world(cart_at(late)))
    builder.transform("/tf", "cart", "block", slider.stamp, in_frames["slider"])
    builder.transform("/tf", "bench", "tool0", pusher.stamp, in_frames["pusher"])
    tip, values = pose_rows(pusher), wrench_rows(wrench())
    along = {
        "world": in_world_axes(values, inverted(np.repeat(builder.turn, len(values), axis=0))),
        "tip": in_sensor_axes(values, tip),
        "sensor": measured_at(wrench(), tip),
    }
    for axes, measured in along.items():
        for how in WRENCHES:
            builder.wrenches(f"/ft/{how}/{axes}", how, "world" if axes == "world" else "sensor", measured)
    builder.scalars()
    lab.messages = [
        (sent - LATENCY if _has_log_time(topic, lab.kinds[topic]) else sent, topic, data)
        for sent, topic, data in lab.messages
    ]
    return damaged(lab)


def _has_log_time(topic: str, kind: str) -> bool:
    return topic.startswith("/ft/field") or kind.removeprefix("geometry_msgs/msg/") in ("Pose", "Transform", "Wrench")


class _Builder:
    def __init__(self, up: str, back: int) -> None:
        self.lab, self.turn = Lab(OWN), np.array([[0.0, 0.0, 0.0, *TURNS[up]]])
        stamp = original().slider.stamp
        self._back, self._middle = back, int(stamp[len(stamp) * 3 // 5])

    def in_world(self, rows: Array) -> Array:
        """Poses (n, 7) of a world whose z axis is up, in the laboratory's."""
        return composed(inverted(np.repeat(self.turn, len(rows), axis=0)), rows)

    def header(self, stamp: int, frame: str, at: str = "header") -> dict[str, object]:
        told = stamp - self._back * (stamp > self._middle)
        return {**self.lab.header(told, at), f"{at}.frame_id": frame}

    def poses(self, topic: str, how: str, frame: str, stamp: IntArray, rows: Array) -> None:
        numbered = zip(stamp.tolist(), rows, strict=True)
        fill = {"field": self._state, "square": self._matrix, "flat": self._matrix, "rotation": self._matrix,
                "parts": self._parts, "named": self._bodies, "numbered": self._bodies}.get(how, self._pose)  # fmt: skip
        self.lab.add(
            topic, TYPES[how][0], stamp, (fill(k, at, row, how, frame) for k, (at, row) in enumerate(numbered))
        )

    def _pose(self, _: int, stamp: int, row: Array, how: str, frame: str) -> dict[str, object]:
        of_transform = "transform" in how
        names = ("translation", "rotation") if of_transform else ("position", "orientation")
        numbers = {path.lstrip("."): value for path, value in pose_values(row, TYPES[how][1], names).items()}
        return numbers if how.startswith("plain") else {**self.header(stamp, frame), **numbers}

    def _state(self, number: int, stamp: int, row: Array, how: str, frame: str) -> dict[str, object]:
        numbers = pose_values(row, TYPES[how][1], ("position", "orientation"))
        return {"notes": ["word" * (number % 4)], **self.header(stamp, frame, "odom.pose.header"), **numbers}

    def _matrix(self, _: int, stamp: int, row: Array, how: str, frame: str) -> dict[str, object]:
        full = np.eye(4)
        full[:3, :3] = turned(np.repeat(row[None, 3:], 3, axis=0), np.eye(3)).T
        full[:3, 3] = row[:3]
        parts = {"full": full.T.ravel(), "top": full[:3].astype(np.float32).ravel(), "place": full[:3, 3].copy(),
                 "turn": full[:3, :3].ravel()}  # fmt: skip
        return {**self.header(stamp, frame), **parts}

    def _parts(self, _: int, stamp: int, row: Array, how: str, frame: str) -> dict[str, object]:
        numbers = dict(zip([f"place.{a}" for a in "xyz"] + [f"turn.{a}" for a in "xyzw"], row.tolist(), strict=True))
        return {**self.header(stamp, frame), **numbers}

    def _bodies(self, number: int, stamp: int, row: Array, how: str, frame: str) -> dict[str, object]:
        """The wanted body among others, in any order; some messages lack it."""
        other = np.array([9.0, 9.0, 9.0, 0.0, 0.0, 0.0, 1.0])
        bodies = [self._body("block", 7, row), self._body("lamp", 8, other), self._body("a thing", 3, other)]
        chosen = [bodies, bodies[::-1], bodies[1:] + bodies[:1], bodies[:2]][number % 4]
        return {**self.header(stamp, frame), "bodies": bodies[1:] if number % 29 == 0 else chosen}

    def _body(self, name: str, number: int, row: Array) -> Any:
        made = zeros(self.lab.store, BODY)
        for path, value in pose_values(row, "pose", ("position", "orientation")).items():
            assign(made, path, value)
        made.name, made.id = name, number
        return made

    def transform(self, topic: str, parent: str, child: str, stamp: IntArray, rows: Array) -> None:
        def message(at: int, row: Array) -> Mapping[str, object]:
            one = zeros(self.lab.store, "geometry_msgs/msg/TransformStamped")
            numbers = pose_values(row, "transform", ("translation", "rotation"))
            for path, value in {**self.header(at, parent), "child_frame_id": child, **numbers}.items():
                assign(one, path, value)
            return {"transforms": [one]}

        pairs = zip(stamp.tolist(), rows, strict=True)
        self.lab.add(topic, "tf2_msgs/msg/TFMessage", stamp, (message(at, row) for at, row in pairs))

    def wrenches(self, topic: str, how: str, frame: str, values: Array) -> None:
        kind, parts, _ = WRENCHES[how]
        names = [f"{part}.{axis}" for part in parts for axis in "xyz"]

        def message(number: int, at: int, row: list[float]) -> dict[str, object]:
            numbers = dict(zip(names, row, strict=True))
            if how == "field":
                own = {"notes": ["a"] * (number % 3), "odom.age": float(number)}
                return {**own, **self.header(at, frame, "odom.header"), **numbers}
            return numbers if how == "plain" else {**self.header(at, frame), **numbers}

        given = values + BIAS if how == "biased" else values
        rows = zip(wrench().stamp.tolist(), given.tolist(), strict=True)
        self.lab.add(topic, kind, wrench().stamp, (message(k, at, row) for k, (at, row) in enumerate(rows)))

    def scalars(self) -> None:
        """One of them is not finite; the first and a later one with a header are of another clock."""
        every = original().slider.stamp[::3]
        times = np.where(np.isin(np.arange(len(every)), [0, 30]), every + 7200 * SECOND, every).tolist()
        for topic, (kind, field) in SCALARS.items():
            headed = kind.startswith("sensor_msgs")
            self.lab.add(topic, kind, every, (
                {**(self.header(at, "") if headed else {}), field: np.nan if k == 5 else float(k)}
                for k, at in enumerate(times)
            ))  # fmt: skip
        self.lab.add("/counts", "lab_msgs/msg/Counts", every, (
            {"values": np.array([0, 1, k, 3], np.int32)} for k in range(len(every))
        ))  # fmt: skip


def damaged(lab: Lab) -> Lab:
    """The same with messages that cannot be read: the 20th and the 21st of each topic but /tf_static."""
    seen = dict.fromkeys(lab.kinds, 0)
    for place, (sent, topic, data) in enumerate(lab.messages):
        seen[topic] += 1
        if seen[topic] in (20, 21) and topic != "/tf_static":
            lab.messages[place] = (sent, topic, data[:7])
    return lab


def topics_of(
    slider: str = "stamped", pusher: str = "stamped", world: bool = False, axes: str = "world", force: str = "stamped",
    up: str = "", stamp: str = "",
) -> Topics:  # fmt: skip
    """Topics of a combination; world: given, with poses in other frames. force: of WRENCHES, or `none`."""
    named = {
        name: f"/tf:{frame}" if how == "tf" else _text(f"/{name}/{how}/{'other' if world else 'world'}", TYPES[how][2])
        for name, how, frame in (("slider", slider, "block"), ("pusher", pusher, "tool0"))
    }
    given = force if force == "none" else _text(f"/ft/{force}/{axes}", WRENCHES[force][2])
    ups = f"{up},wrench={up}" if up and axes == "world" else up
    return Topics(**named, wrench=given, covariates=(*SCALARS, COUNTS, AGE, NUMBER), world="world" if world else "",
                  wrench_frame=axes, up=ups, stamp=stamp)  # fmt: skip


def _text(topic: str, field: str) -> str:
    topic = topic.replace(" ", "_")
    return f"{topic}.{field}" if field else topic


def topics_in(topics: Topics) -> list[str]:
    """The names of the topics to read, with that of tf that moves, without the static one."""
    given = (topics.slider, topics.pusher, topics.wrench, *topics.covariates)
    return [*dict.fromkeys(["/tf", *(text.partition(":")[0].partition(".")[0] for text in given)])]


@cache
def by_topic(up: str = "", back: int = 0) -> dict[str, list[Message]]:
    """The messages of each topic of a laboratory, in order of log time."""
    found: dict[str, list[Message]] = {}
    for message in laboratory(up, back).in_order():
        found.setdefault(message[1], []).append(message)
    return found


def in_order(topics: Topics, lags: Sequence[int], up: str = "", back: int = 0) -> list[Message]:
    """The messages that a decoder of these topics is given, each topic behind by its lag (ns); /tf_static comes first.

    Log times stay as they are.
    """
    names, messages = topics_in(topics), by_topic(up, back)
    behind = dict(zip(names, lags, strict=False))
    found = [message for name in names for message in messages.get(name, [])]
    return [*messages["/tf_static"], *sorted(found, key=lambda each: each[0] + behind.get(each[1], 0))]
