# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Bags as laboratories record them: their own names and types, serialized by the package `rosbags`."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from repository import REPOSITORY

from push_predictor.geometry.frames import quaternion_of_yaw
from push_predictor.recordings.bag.writer import BagWriter
from push_predictor.recordings.fields.pose_rows import composed, inverted, normalised
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.rig import RECORD_NAME, Rig
from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream, taken
from push_predictor.recordings.topics import Topics

Message = tuple[int, str, bytes]  # log time, topic, CDR
SECONDS = 8.0
LATENCY = 7_000_000  # ns from the header stamp to the log time
LABORATORY = Topics("/vicon/block/block", "/tf:tool0", "/netft")
BASE = [0.4, -0.3, 0.1, 0.0, 0.0, 0.0, 1.0]  # the robot's base in the world


@cache
def whole_recording(name: str) -> Recording:
    """A recording in bags/, read once."""
    return read_recording(REPOSITORY / "bags" / name)


def short_recording(seconds: float = SECONDS, after: float = 0.0) -> Recording:
    """Some seconds of the recording bags/square_abs_test, without scalars."""
    whole = whole_recording("square_abs_test")
    begin = int(whole.slider.stamp[0]) + round(after * 1e9)
    end = begin + round(seconds * 1e9)

    def cut(stream: Any) -> Any:
        kept = (stream.stamp >= begin) & (stream.stamp < end)
        return taken(stream, kept)

    return replace(whole, slider=cut(whole.slider), pusher=cut(whole.pusher), wrench=cut(whole.wrench), scalars={})


def store(definitions: Mapping[str, str] = {}) -> Any:
    """The types of ROS 2 Jazzy and others with their definitions."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS2_JAZZY)
    for name, text in definitions.items():
        types.register(get_types_from_msg(text, name))
    return types


class Lab:
    """Builds messages of a laboratory; add streams, then write."""

    def __init__(self, definitions: Mapping[str, str] = {}, frame: str = "world") -> None:
        self.store, self.frame = store(definitions), frame
        self.kinds: dict[str, str] = {}
        self.messages: list[Message] = []

    def add(self, topic: str, kind: str, stamps: Any, filled: Iterator[Mapping[str, object]]) -> None:
        """Messages of a type: zeros, with some fields set by their dotted path."""
        self.kinds[topic] = kind
        message, paths = None, None
        for stamp, values in zip(np.asarray(stamps).tolist(), filled, strict=True):
            if values.keys() != paths:  # else all that the last message has is set anew
                message, paths = zeros(self.store, kind), values.keys()
            for path, value in values.items():
                assign(message, path, value)
            self.messages.append((stamp + LATENCY, topic, bytes(self.store.serialize_cdr(message, kind))))

    def pose(self, topic: str, kind: str, stream: PoseStream, at: str, header: str = "header", **more: object) -> None:
        """Poses of a stream in the field `at` of a type."""
        self.poses(topic, kind, stream.stamp, pose_rows(stream), at, header, **more)

    def poses(
        self, topic: str, kind: str, stamps: Any, rows: Any, at: str, header: str = "header", **more: object
    ) -> None:
        """Rows (n, 7) in the field `at` of a type."""
        names = ("translation", "rotation") if at.endswith("transform") else ("position", "orientation")
        self.add(topic, kind, stamps, (
            {**self.header(stamp, header), **more, **pose_values(row, at, names)}
            for stamp, row in zip(np.asarray(stamps).tolist(), rows, strict=True)
        ))  # fmt: skip

    def transform(self, topic: str, parent: str, child: str, stamps: Any, rows: Any) -> None:
        """Messages of tf with one transform each; rows (n, 7)."""

        def message(stamp: int, row: Any) -> Mapping[str, object]:
            one = zeros(self.store, "geometry_msgs/msg/TransformStamped")
            values = {**self.header(stamp, "header"), "header.frame_id": parent, "child_frame_id": child}
            for path, value in {**values, **pose_values(row, "transform", ("translation", "rotation"))}.items():
                assign(one, path, value)
            return {"transforms": [one]}

        pairs = zip(np.asarray(stamps).tolist(), np.asarray(rows), strict=True)
        self.add(topic, "tf2_msgs/msg/TFMessage", stamps, (message(stamp, row) for stamp, row in pairs))

    def wrench(self, topic: str, stream: WrenchStream, kind: str, at: str) -> None:
        """Wrenches in the field `at` of a type."""
        columns = zip(stream.stamp.tolist(), stream.fx, stream.fy, stream.torque, strict=True)
        self.add(topic, kind, stream.stamp, (
            {**self.header(t), f"{at}.force.x": x, f"{at}.force.y": y, f"{at}.torque.z": turn}
            for t, x, y, turn in columns
        ))  # fmt: skip

    def header(self, stamp: int, at: str = "header") -> dict[str, object]:
        """The fields of a header, none if `at` is empty."""
        if not at:
            return {}
        seconds, nanoseconds = divmod(stamp, 1_000_000_000)
        return {f"{at}.stamp.sec": seconds, f"{at}.stamp.nanosec": nanoseconds, f"{at}.frame_id": self.frame}

    def definition(self, kind: str) -> str:
        """The ros2msg definition of a type."""
        return str(self.store.generate_msgdef(kind, ros_version=2)[0])

    def in_order(self) -> list[Message]:
        """The messages in order of log time."""
        return sorted(self.messages, key=lambda message: message[0])

    def mcap(self, path: Path, rig: Rig | None = None) -> Path:
        """Write an MCAP bag."""
        with BagWriter(path) as writer:
            if rig is not None:
                writer.add_metadata(RECORD_NAME, rig.to_record())
            for topic, kind in self.kinds.items():
                kept = "transient_local" if topic.endswith("_static") else "volatile"
                writer.add_topic(topic, kind, self.definition(kind), durability=kept)
            for stamp, topic, data in self.in_order():
                writer.write(topic, stamp, data)
        return path


def laboratory(recording: Recording) -> Lab:
    """A Vicon that tracks the slider, a robot in tf and a force sensor; LABORATORY names their topics."""
    lab = Lab()
    kind = "geometry_msgs/msg/TransformStamped"
    lab.pose(LABORATORY.slider, kind, recording.slider, "transform", child_frame_id="block")
    lab.transform("/tf_static", "world", "base", recording.pusher.stamp[:1], [BASE])
    tip = pose_rows(recording.pusher) - np.array([*BASE[:3], 0.0, 0.0, 0.0, 0.0])
    lab.transform("/tf", "base", "tool0", recording.pusher.stamp, tip)
    assert recording.wrench is not None
    lab.wrench(LABORATORY.wrench, recording.wrench, "geometry_msgs/msg/WrenchStamped", "wrench")
    return lab


def robot_in_tf(recording: Recording) -> Lab:
    """A block below a static camera, and a robot of two moving joints and a static tool."""
    lab, slider, pusher = Lab(), recording.slider, recording.pusher
    block, tip = pose_rows(slider), pose_rows(pusher)
    camera = normalised(np.array([[0.4, -0.2, 1.1, 0.1, 0.7, -0.2, 0.5]]))
    base = normalised(np.array([[-0.5, 0.3, 0.02, 0.0, 0.0, 0.6, 0.8]]))
    tool = normalised(np.array([[0.01, 0.02, 0.03, 0.5, -0.5, 0.1, 0.7]]))
    n = len(pusher)
    angle = np.linspace(0.0, 1.0, n)
    arm = normalised(np.column_stack([angle, -angle, angle**2, np.sin(angle), np.zeros((n, 2)), np.cos(angle)]))
    rows = {"camera": camera, "base": base, "tool": tool}
    everywhere = {name: np.repeat(row, n, axis=0) for name, row in rows.items()}
    in_arm = composed(inverted(composed(everywhere["base"], arm)), composed(tip, inverted(everywhere["tool"])))
    first = slider.stamp[:1]
    lab.transform("/tf_static", "world", "camera", first, camera)
    lab.transform("/tf_static", "/world", "/base", first, base)
    lab.transform("/tf_static", "wrist", "tip", first, tool)
    seen = composed(inverted(np.repeat(camera, len(slider), axis=0)), block)
    lab.transform("/tf", "camera", "block", slider.stamp, seen)
    lab.transform("/tf", "base", "arm", pusher.stamp, arm)
    lab.transform("/tf", "arm", "wrist", pusher.stamp, in_arm)
    return lab


def pose_rows(stream: PoseStream) -> Any:
    """Rows (n, 7) of a planar stream."""
    z, w = quaternion_of_yaw(stream.heading)
    none = np.zeros(len(stream))
    return np.column_stack([stream.x, stream.y, stream.z, none, none, z, w])


def pose_values(row: Any, at: str, names: tuple[str, str]) -> dict[str, object]:
    """The fields of a pose, by their dotted path."""
    paths = [f"{at}.{names[0]}.{axis}" for axis in "xyz"] + [f"{at}.{names[1]}.{axis}" for axis in "xyzw"]
    return dict(zip(paths, row.tolist(), strict=True))


def zeros(types: Any, kind: str) -> Any:
    """A message with zero in every field."""
    made, fields = _makers(types, kind)
    return made(**{name: make() for name, make in fields})


@cache
def _makers(types: Any, kind: str) -> tuple[Any, list[tuple[str, Callable[[], object]]]]:
    """The class of a type and what makes the zero of each field: thousands of messages are made of few types."""
    fields = [(name, _zero(types, node.name, given)) for name, (node, given) in types.get_msgdef(kind).fields]
    return types.types[kind], fields


def _zero(types: Any, node: str, description: Any) -> Callable[[], object]:
    if node == "NAME":
        return partial(zeros, types, description)
    if node == "BASE":
        plain = {"string": "", "bool": False}.get(description[0], 0.0 if "float" in description[0] else 0)
        return lambda: plain
    if node == "ARRAY":
        return partial(np.zeros, description[1], description[0][1][0])
    inner = description[0]
    return list if inner[0].name == "NAME" or inner[1][0] == "string" else partial(np.zeros, 0, inner[1][0])


def assign(message: Any, path: str, value: object) -> None:
    """Set the field at a dotted path."""
    *steps, last = path.split(".")
    for step in steps:
        message = getattr(message, step)
    setattr(message, last, value)


def write_db3(lab: Lab, path: Path, rig: Rig | None = None, *, version: int = 9) -> Path:
    """Write the bag of a laboratory as a folder with a sqlite3 file, by `rosbags`; the rig into metadata.yaml."""
    from rosbags.rosbag2 import Writer

    with Writer(path, version=version) as writer:
        if rig is not None:
            writer.set_custom_data(RECORD_NAME, json.dumps(rig.to_record()))
        connections = {
            topic: writer.add_connection(topic, kind, typestore=lab.store) for topic, kind in lab.kinds.items()
        }
        for stamp, topic, data in lab.in_order():
            writer.write(connections[topic], stamp, data)
    return path


def write_ros1(lab: Lab, path: Path) -> Path:
    """Write the bag of a laboratory as a ROS 1 bag, with the definitions of ROS 1."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    noetic = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as writer:
        connections = {}
        for topic, kind in lab.kinds.items():
            if kind in noetic.types:
                definition, digest = noetic.generate_msgdef(kind, ros_version=1)
            else:
                definition, digest = lab.store.generate_msgdef(kind, ros_version=1)
            connections[topic] = writer.add_connection(topic, kind, msgdef=definition, md5sum=digest)
        for stamp, topic, data in lab.in_order():
            writer.write(connections[topic], stamp, bytes(lab.store.cdr_to_ros1(data, lab.kinds[topic])))
    return path


def write_without_schema(lab: Lab, path: Path, *topics: str) -> Path:
    """Write a file in which these topics have no schema."""
    return write_schemas(lab, path, dict.fromkeys(topics))


def write_schemas(lab: Lab, path: Path, schemas: Mapping[str, tuple[str, str] | None]) -> Path:
    """Write a file in which some topics have another schema (encoding, text), or none, by the package `mcap`."""
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        channels = {}
        for topic, kind in lab.kinds.items():
            schema = schemas.get(topic, ("ros2msg", lab.definition(kind)))
            number = 0 if schema is None else writer.register_schema(kind, schema[0], schema[1].encode())
            channels[topic] = writer.register_channel(topic, "cdr", number)
        for stamp, topic, data in lab.in_order():
            writer.add_message(channels[topic], stamp, data, stamp)
        writer.finish()
    return path
