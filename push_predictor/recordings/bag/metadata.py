# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""metadata.yaml of a rosbag2 folder, read and written (version 9, ROS 2 Jazzy)."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.messages import Notes
from push_predictor.recordings.rig import RECORD_NAME, REQUIRED

METADATA_FILE = "metadata.yaml"
VERSION = 9
_ROOT = "rosbag2_bagfile_information"
_DAMAGED = (OSError, ValueError, RecursionError, KeyError, TypeError, AttributeError)
_FOREVER = {"sec": 9223372036, "nsec": 854775807}


@dataclass(frozen=True)
class BagMetadata:
    """files: as in relative_file_paths; custom_data: {record name: {key: value}}; notes: faults found."""

    files: tuple[str, ...] = ()
    custom_data: dict[str, Mapping[str, object]] = field(default_factory=dict)
    notes: Notes = field(default_factory=Notes)


@dataclass
class TopicInfo:
    """A topic of metadata.yaml. count: of its messages.

    durability: 'volatile' or 'transient_local'; reliability: 'reliable' or 'best_effort'.
    """

    name: str
    type: str
    count: int
    type_hash: str = ""
    depth: int = 10
    durability: str = "volatile"
    reliability: str = "reliable"


def read_bag_metadata(folder: Path) -> BagMetadata:
    """Read metadata.yaml; an unreadable file becomes a note.

    Raises RecordingError for a storage that is neither MCAP nor sqlite3, and for a compression that rosbag2 does not
    include.
    """
    import yaml

    path = folder / METADATA_FILE
    try:
        information = _parsed(path.read_text(encoding="utf-8"))[_ROOT]
        files = tuple(str(name) for name in information.get("relative_file_paths") or ())
    except FileNotFoundError:
        return BagMetadata()
    except (*_DAMAGED, yaml.YAMLError) as error:
        reason = str(error).replace("\n", " ")
        unread = BagMetadata()
        unread.notes.add(f"{path}: cannot be read ({reason}); the files are used in order of name")
        return unread
    _check_kinds(information, path)
    return BagMetadata(files, _records(information.get("custom_data")))


def embedded_records(metadata: Mapping[str, Mapping[str, str]]) -> dict[str, Mapping[str, object]]:
    """The custom_data in the MCAP record `rosbag2`, in which rosbag2 stores a copy of metadata.yaml."""
    import yaml

    try:
        information = _parsed(metadata["rosbag2"]["serialized_metadata"])
    except (*_DAMAGED, yaml.YAMLError):
        return {}
    return _records(information.get("custom_data")) if isinstance(information, dict) else {}


@lru_cache(maxsize=16)
def _parsed(text: str) -> Any:
    """The content of YAML text, which nobody changes: a bag has the same text twice, and is opened several times.

    Parsed in Python: libyaml, ten times as fast, crashes on text that is nested deeply.
    """
    import yaml

    return yaml.safe_load(text)


def bag_metadata_text(
    file: str, start: int, duration: int, topics: Collection[TopicInfo], records: Mapping[str, Mapping[str, str]]
) -> str:
    """metadata.yaml for one file; start and duration in ns.

    Records become custom_data as JSON: rosbag2 refuses to play a bag whose custom_data is not text.
    """
    span = {"starting_time": {"nanoseconds_since_epoch": start}, "duration": {"nanoseconds": duration}}
    count = sum(topic.count for topic in topics)
    information = {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": span["duration"],
        "starting_time": span["starting_time"],
        "message_count": count,
        "topics_with_message_count": [_topic(topic) for topic in topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file],
        "files": [{"path": file, **span, "message_count": count}],
        "custom_data": {name: json.dumps(record) for name, record in records.items()} or None,
        "ros_distro": "jazzy",
    }
    return _plain_dump({_ROOT: information})


def qos_text(topic: TopicInfo) -> str:
    """The offered QoS of a topic, as in a channel of the MCAP file."""
    return _plain_dump(_qos(topic)).strip()


def _plain_dump(data: object) -> str:
    """YAML without anchors: rosbag2 reads them, other tools may not."""
    import yaml

    unshared = json.loads(json.dumps(data))  # YAML writes an anchor for every object that occurs twice
    return str(yaml.safe_dump(unshared, sort_keys=False))


def _topic(topic: TopicInfo) -> dict[str, object]:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.type,
            "serialization_format": "cdr",
            "offered_qos_profiles": _qos(topic),
            "type_description_hash": topic.type_hash,
        },
        "message_count": topic.count,
    }


def _qos(topic: TopicInfo) -> list[dict[str, object]]:
    return [
        {
            "history": "keep_last",
            "depth": topic.depth,
            "reliability": topic.reliability,
            "durability": topic.durability,
            "deadline": _FOREVER,
            "lifespan": _FOREVER,
            "liveliness": "automatic",
            "liveliness_lease_duration": _FOREVER,
            "avoid_ros_namespace_conventions": False,
        }
    ]


def _check_kinds(information: Mapping[str, object], path: Path) -> None:
    """Raise RecordingError for a storage or a compression that is not read; else the bytes show what they are."""
    if (storage := information.get("storage_identifier", "mcap")) not in ("mcap", "sqlite3", ""):
        raise RecordingError(f"{path}: storage {storage!r} is not accepted, give mcap or sqlite3")
    mode = str(information.get("compression_mode") or "none").lower()
    kind = str(information.get("compression_format") or "").lower()
    if mode != "none" and (mode not in ("file", "message") or kind != "zstd"):
        raise RecordingError(f"{path}: compression {kind!r} by {mode} is not accepted, give zstd by file or message")


def _records(custom_data: object) -> dict[str, Mapping[str, object]]:
    """The records in custom_data: a mapping or its JSON text by record name, or the keys of a rig themselves."""
    if not isinstance(custom_data, dict):
        return {}
    mappings = {str(name): _mapping(value) for name, value in custom_data.items()}
    records = {name: mapping for name, mapping in mappings.items() if mapping is not None}
    if RECORD_NAME not in records and all(key in custom_data for key in REQUIRED):
        records[RECORD_NAME] = custom_data
    return records


def _mapping(value: object) -> Mapping[str, object] | None:
    try:
        parsed = json.loads(value) if isinstance(value, str) else value
    except ValueError:
        return None
    return parsed if isinstance(parsed, dict) else None
