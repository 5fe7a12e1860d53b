# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Write a recording as a rosbag2 folder: one MCAP file with CDR messages and metadata.yaml."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from benchmarks.points_rig.arrays import Array, IntArray
from benchmarks.points_rig.schemas import DEFINITIONS
from benchmarks.points_rig.sensors import Readings, Streams

POSE, WRENCH, SCALAR = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped", "std_msgs/msg/Float64"
LATENCY = {"slider/pose": 4_000_000, "pusher/pose": 1_000_000, "pusher/wrench": 1_500_000}  # ns from stamp to arrival
_CDR = ("cdr", "S4")  # encapsulation header: little-endian CDR
_HEADER = [_CDR, ("sec", "<i4"), ("nanosec", "<u4"), ("frame_length", "<u4"), ("frame", "S12")]


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


def write_bag(folder: Path, streams: Streams, rig_record: dict[str, str], epoch: float) -> None:
    """Write a bag folder; `epoch` (s) is the absolute time of the session's start."""
    folder.mkdir(parents=True, exist_ok=True)
    topics = _topics(streams, epoch)
    name = f"{folder.name}_0.mcap"
    _write_mcap(folder / name, topics, rig_record)
    (folder / "metadata.yaml").write_text(_metadata(topics, name, rig_record), encoding="utf-8")


def _topics(streams: Streams, epoch: float) -> list[Topic]:
    slider, tip, (x, y, torque) = streams.slider.values, streams.tip.values, streams.wrench.values.T
    flat, upright = np.zeros((len(slider), 3)), np.tile([0.0, 0.0, 0.0, 1.0], (len(tip), 1))
    half = slider[:, 2] / 2
    poses = np.column_stack([slider[:, :2], flat, np.sin(half), np.cos(half)])
    return [
        _stamped("slider/pose", POSE, streams.slider, poses, epoch),
        _stamped("pusher/pose", POSE, streams.tip, np.column_stack([tip, upright]), epoch),
        _stamped(
            "pusher/wrench", WRENCH, streams.wrench, np.column_stack([x, y, *np.zeros((3, len(x))), torque]), epoch
        ),
        *(_scalar(name, readings, epoch) for name, readings in streams.topics.items()),
    ]


def _stamped(name: str, kind: str, readings: Readings, columns: Array, epoch: float) -> Topic:
    """Messages of a header in frame `world` and numbers (M, D)."""
    stamps = _nanoseconds(readings.stamps, epoch)
    rows = _rows(_HEADER, columns)
    rows["sec"], rows["nanosec"] = np.divmod(stamps, 1_000_000_000)
    rows["frame_length"], rows["frame"] = 6, b"world"
    return Topic(f"/{name}", kind, stamps + LATENCY[name], rows)


def _scalar(name: str, readings: Readings, epoch: float) -> Topic:
    return Topic(f"/{name}", SCALAR, _nanoseconds(readings.stamps, epoch), _rows([_CDR], readings.values))


def _rows(layout: list[tuple[str, str]], columns: Array) -> NDArray[np.void]:
    rows = np.zeros(len(columns), dtype=np.dtype([*layout, ("numbers", "<f8", (columns.shape[1],))]))
    rows["cdr"], rows["numbers"] = b"\x00\x01\x00\x00", columns
    return rows


def _nanoseconds(stamps: Array, epoch: float) -> IntArray:
    return np.int64(epoch) * 1_000_000_000 + np.rint(stamps * 1e9).astype(np.int64)


def _write_mcap(path: Path, topics: list[Topic], rig_record: dict[str, str]) -> None:
    """Write all messages in order of arrival."""
    arrival = np.concatenate([topic.arrival for topic in topics])
    source = np.repeat(np.arange(len(topics)), [len(topic.rows) for topic in topics])
    payloads = [payload for topic in topics for payload in topic.payloads()]
    order = np.argsort(arrival, kind="stable")
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.LZ4)
        writer.start(profile="ros2", library="points_rig")
        writer.add_metadata("push_rig", rig_record)
        schemas = {kind: writer.register_schema(kind, "ros2msg", text.encode()) for kind, text in DEFINITIONS.items()}
        channels = [
            writer.register_channel(topic.name, "cdr", schemas[topic.type], {"offered_qos_profiles": "[]"})
            for topic in topics
        ]
        for row, log, topic in zip(order.tolist(), arrival[order].tolist(), source[order].tolist(), strict=True):
            writer.add_message(channels[topic], log, payloads[row], log)
        writer.finish()


def _metadata(topics: list[Topic], name: str, rig_record: dict[str, str]) -> str:
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
    information |= {"files": [{"path": name, **span}], "custom_data": rig_record, "ros_distro": "jazzy"}
    return json.dumps({"rosbag2_bagfile_information": information}, indent=2) + "\n"
