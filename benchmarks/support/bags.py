# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Write a recording of an independent rig as a rosbag2 folder: one MCAP file with CDR messages and metadata.yaml."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from benchmarks.support.plane import Array, IntArray

POSE, WRENCH, SCALAR = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped", "std_msgs/msg/Float64"
_CDR = ("cdr", "S4")  # encapsulation header: little-endian CDR
_HEADER = [_CDR, ("sec", "<i4"), ("nanosec", "<u4"), ("frame_length", "<u4"), ("frame", "S12")]
_PARTS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
}
_STAMPED = ("std_msgs/Header", "builtin_interfaces/Time")


def _definition(text: str, *parts: str) -> str:
    """A ros2msg definition followed by those of the types that it uses."""
    return text + "".join(f"{'=' * 80}\nMSG: {part}\n{_PARTS[part]}" for part in parts)


_DEFINITIONS = {
    POSE: _definition(
        "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
        *(*_STAMPED, "geometry_msgs/Pose", "geometry_msgs/Point", "geometry_msgs/Quaternion"),
    ),
    WRENCH: _definition(
        "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n",
        *(*_STAMPED, "geometry_msgs/Wrench", "geometry_msgs/Vector3"),
    ),
    SCALAR: "float64 data\n",
}


@dataclass(frozen=True)
class Topic:
    """A topic's serialised messages in order of arrival (ns)."""

    name: str
    type: str
    arrival: IntArray
    rows: NDArray[np.void]

    def payloads(self) -> list[bytes]:
        """The messages one by one."""
        data, size = self.rows.tobytes(), self.rows.itemsize
        return [data[begin : begin + size] for begin in range(0, len(data), size)]


@dataclass(frozen=True)
class Samples:
    """One topic of a session: times (n,) in s from its start, and values (n, d)."""

    time: Array
    values: Array

    def stamps(self, start: int) -> IntArray:
        """The times in ns since 1970; start: that of the session."""
        return np.asarray(start + np.rint(self.time * 1e9).astype(np.int64))


def poses(name: str, stamps: IntArray, place: Array, yaw: Array, latency: int) -> Topic:
    """PoseStamped in frame `world`: stamps (n,) and latency in ns, place (n, 3) in m, yaw (n,) in rad."""
    zeros, half = np.zeros((len(yaw), 2)), yaw / 2
    return _stamped(name, POSE, stamps, np.column_stack([place, zeros, np.sin(half), np.cos(half)]), latency)


def wrenches(name: str, stamps: IntArray, force_torque: Array, latency: int) -> Topic:
    """WrenchStamped in frame `world` from force and torque (n, 6), N and N m."""
    return _stamped(name, WRENCH, stamps, force_torque, latency)


def scalars(name: str, arrival: IntArray, values: Array) -> Topic:
    """Float64, which has no stamp, from values (n, 1)."""
    return Topic(name, SCALAR, arrival, _rows([_CDR], values))


def write_bag(folder: Path, topics: Sequence[Topic], rig_record: Mapping[str, str], library: str) -> None:
    """Write a bag folder; `library` is the program that the file names as its writer."""
    folder.mkdir(parents=True, exist_ok=True)
    name = f"{folder.name}_0.mcap"
    _write_mcap(folder / name, topics, rig_record, library)
    (folder / "metadata.yaml").write_text(_metadata(topics, name, rig_record), encoding="utf-8")


def _stamped(name: str, kind: str, stamps: IntArray, columns: Array, latency: int) -> Topic:
    rows = _rows(_HEADER, columns)
    rows["sec"], rows["nanosec"] = np.divmod(stamps, 1_000_000_000)
    rows["frame_length"], rows["frame"] = 6, b"world"
    return Topic(name, kind, stamps + latency, rows)


def _rows(layout: list[tuple[str, str]], columns: Array) -> NDArray[np.void]:
    rows = np.zeros(len(columns), dtype=np.dtype([*layout, ("numbers", "<f8", (columns.shape[1],))]))
    rows["cdr"], rows["numbers"] = b"\x00\x01\x00\x00", columns
    return rows


def _write_mcap(path: Path, topics: Sequence[Topic], rig_record: Mapping[str, str], library: str) -> None:
    """Write all messages in order of arrival."""
    arrival = np.concatenate([topic.arrival for topic in topics])
    source = np.repeat(np.arange(len(topics)), [len(topic.rows) for topic in topics])
    payloads = [payload for topic in topics for payload in topic.payloads()]
    order = np.argsort(arrival, kind="stable")
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.LZ4)
        writer.start(profile="ros2", library=library)
        writer.add_metadata("push_rig", dict(rig_record))
        schemas = {kind: writer.register_schema(kind, "ros2msg", text.encode()) for kind, text in _DEFINITIONS.items()}
        channels = [
            writer.register_channel(topic.name, "cdr", schemas[topic.type], {"offered_qos_profiles": "[]"})
            for topic in topics
        ]
        for row, log, topic in zip(order.tolist(), arrival[order].tolist(), source[order].tolist(), strict=True):
            writer.add_message(channels[topic], log, payloads[row], log)
        writer.finish()


def _metadata(topics: Sequence[Topic], name: str, rig_record: Mapping[str, str]) -> str:
    """The text of metadata.yaml, in YAML's flow style."""
    begin, end = min(int(topic.arrival[0]) for topic in topics), max(int(topic.arrival[-1]) for topic in topics)
    span = {
        "duration": {"nanoseconds": end - begin},
        "starting_time": {"nanoseconds_since_epoch": begin},
        "message_count": sum(len(topic.rows) for topic in topics),
    }
    common = {"serialization_format": "cdr", "offered_qos_profiles": [], "type_description_hash": ""}
    listed = [
        {"topic_metadata": {"name": topic.name, "type": topic.type, **common}, "message_count": len(topic.rows)}
        for topic in topics
    ]
    information = {"version": 9, "storage_identifier": "mcap", **span, "topics_with_message_count": listed}
    information |= {"compression_format": "", "compression_mode": "", "relative_file_paths": [name]}
    information |= {"files": [{"path": name, **span}], "custom_data": dict(rig_record), "ros_distro": "jazzy"}
    return json.dumps({"rosbag2_bagfile_information": information}, indent=2) + "\n"
