# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Small MCAP recordings, written with the mcap library alone: independent of the project's own writer."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable
from pathlib import Path

from mcap.writer import CompressionType, Writer

START = 1_700_000_000_000_000_000
POSE = "geometry_msgs/msg/PoseStamped"
WRENCH = "geometry_msgs/msg/WrenchStamped"
RIG = {
    "shape": "rect1",
    "outline": json.dumps([[-0.045, -0.045], [0.045, -0.045], [0.045, 0.045], [-0.045, 0.045]]),
    "pusher_radius": "0.00475",
    "surface": "plywood",
    "object_mass": "0.8",
}


def stamped(time: int, numbers: Iterable[float], frame: bytes = b"world\0") -> bytes:
    """CDR of a message of a header and float64 numbers: a PoseStamped with 7, a WrenchStamped with 6."""
    numbers = list(numbers)
    head = struct.pack("<iII", *divmod(time, 10**9), len(frame)) + frame
    body = head + b"\0" * (-len(head) % 8) + struct.pack(f"<{len(numbers)}d", *numbers)
    return b"\0\1\0\0" + body


def push_messages(duration: float, rate: float = 250.0) -> list[tuple[str, str, int, bytes]]:
    """(topic, type, log time, bytes) of a slider and a pusher at `rate` and a wrench at half of it."""
    messages = []
    for k in range(round(duration * rate)):
        time = START + round(k * 1e9 / rate)
        messages.append(("/slider/pose", POSE, time, stamped(time - 1000, [k, 0, 0, 0, 0, 0, 1])))
        messages.append(("/pusher/pose", POSE, time + 500_000, stamped(time, [0, k, 0, 0, 0, 0, 1])))
        if k % 2 == 0:
            messages.append(("/pusher/wrench", WRENCH, time + 900_000, stamped(time, [k, 1, 0, 0, 0, 0])))
    return messages


def write_bag(path: Path, messages: Iterable[tuple[str, str, int, bytes]], rig: dict[str, str] | None = RIG) -> Path:
    """Write a bare .mcap file, in the order given."""
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, chunk_size=64_000)
        writer.start(profile="ros2", library="test")
        channels: dict[str, int] = {}
        for topic, kind, time, data in messages:
            if topic not in channels:
                schema = writer.register_schema(kind, "ros2msg", b"")
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], time, data, time)
        if rig is not None:
            writer.add_metadata("push_rig", rig)
        writer.finish()
    return path
