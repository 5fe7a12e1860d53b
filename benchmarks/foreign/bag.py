# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Write a sensed session as a rosbag2 bag: a folder with an MCAP file and metadata.yaml."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from mcap_ros2.writer import Writer

from benchmarks.foreign import messages
from benchmarks.foreign.arrays import Integers
from benchmarks.foreign.messages import Message
from benchmarks.foreign.rig import Rig
from benchmarks.foreign.sensing import Samples, SensedSession

LOG_DELAY = 300_000  # ns between a stamp and its arrival at the recorder


@dataclass(frozen=True)
class Stream:
    """The messages of one topic in order; `arrival` in ns, ascending."""

    topic: str
    type_name: str
    arrival: Integers
    content: Iterator[Message]


def write_bag(folder: Path, rig: Rig, sensed: SensedSession, start: int) -> None:
    """Write the bag `folder`; `start` is the recording's first instant in ns since 1970."""
    streams = _streams(sensed, start)
    record = {key: value if isinstance(value, str) else json.dumps(value) for key, value in rig.record().items()}
    folder.mkdir(parents=True, exist_ok=True)
    name = f"{folder.name}_0.mcap"
    with (folder / name).open("wb") as file, Writer(file) as writer:
        writer.add_metadata("push_rig", record)
        _write_messages(writer, streams)
    facts = _bag_facts(name, streams, record)
    (folder / "metadata.yaml").write_text(yaml.safe_dump(facts, sort_keys=False, width=10_000))


def _write_messages(writer: Writer, streams: list[Stream]) -> None:
    """Write the messages of all topics in order of arrival."""
    names = dict.fromkeys(stream.type_name for stream in streams)
    schemas = {name: writer.register_msgdef(name, messages.definition(name)) for name in names}
    owner = np.concatenate([np.full(len(stream.arrival), place) for place, stream in enumerate(streams)])
    arrival = np.concatenate([stream.arrival for stream in streams])
    order = np.argsort(arrival, kind="stable")
    for place, time in zip(owner[order].tolist(), arrival[order].tolist(), strict=True):
        stream = streams[place]
        writer.write_message(stream.topic, schemas[stream.type_name], next(stream.content), time, time)


def _streams(sensed: SensedSession, start: int) -> list[Stream]:
    streams = []
    for topic, samples in [("/slider/pose", sensed.slider), ("/pusher/pose", sensed.pusher)]:
        stamps = _stamps(samples, start)
        content = messages.poses(stamps, samples.values)
        streams.append(Stream(topic, messages.POSE_STAMPED, stamps + LOG_DELAY, content))
    stamps = _stamps(sensed.wrench, start)
    content = messages.wrenches(stamps, sensed.wrench.values)
    streams.append(Stream("/pusher/wrench", messages.WRENCH_STAMPED, stamps + LOG_DELAY, content))
    for topic, samples in sensed.scalars.items():
        arrival = _stamps(samples, start) + LOG_DELAY
        streams.append(Stream(topic, messages.FLOAT64, arrival, messages.scalars(samples.values)))
    return streams


def _stamps(samples: Samples, start: int) -> Integers:
    return np.asarray(start + np.round(samples.time * messages.SECOND).astype(np.int64))


def _bag_facts(file: str, streams: list[Stream], record: dict[str, str]) -> dict[str, object]:
    """The content of metadata.yaml, version 9."""
    first = min(int(stream.arrival[0]) for stream in streams)
    last = max(int(stream.arrival[-1]) for stream in streams)
    count = sum(len(stream.arrival) for stream in streams)
    span = {"duration": {"nanoseconds": last - first}, "starting_time": {"nanoseconds_since_epoch": first}}
    information: dict[str, object] = {
        "version": 9,
        "storage_identifier": "mcap",
        **span,
        "message_count": count,
        "topics_with_message_count": [_topic_facts(stream) for stream in streams],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file],
        "files": [{"path": file, **copy.deepcopy(span), "message_count": count}],
        "custom_data": record,
        "ros_distro": "jazzy",
    }
    return {"rosbag2_bagfile_information": information}


def _topic_facts(stream: Stream) -> dict[str, object]:
    metadata = {
        "name": stream.topic,
        "type": stream.type_name,
        "serialization_format": "cdr",
        "offered_qos_profiles": [],
        "type_description_hash": "",
    }
    return {"topic_metadata": metadata, "message_count": len(stream.arrival)}
