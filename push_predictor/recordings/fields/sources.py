# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Where a stream is in a bag: a topic, a field of its messages or a frame; its messages in the type of a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.cdr import POSE_STAMPED, WRENCH_STAMPED, Layout, encode
from push_predictor.recordings.bag.definitions import POSE, SCALAR_LAYOUTS, WRENCH
from push_predictor.recordings.fields.columns import NUMBERS, Block, blocks
from push_predictor.recordings.fields.message_text import (
    STANDARD,
    Definitions,
    fields_of_types,
    parse_definitions,
    short_name,
    type_at,
)
from push_predictor.types import IntArray

TF_TYPES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
JOINTS = "sensor_msgs/msg/JointState"
STAMPED_SCALAR = "sensor_msgs/msg/Temperature"  # the type of a scalar that was a field of a message with a header
_NANO = 1_000_000_000


@dataclass(frozen=True)
class Target:
    """What a stream needs: the type of its messages in a recording, and types (package/Name) of fields that fit.

    known: {message type: field that is read without being named}.
    """

    type: str
    layout: Layout
    parts: frozenset[str]
    known: Mapping[str, str]
    what: str


POSE_TARGET = Target(
    POSE.name,
    POSE_STAMPED,
    frozenset({"geometry_msgs/Pose", "geometry_msgs/Transform"}),
    {
        POSE.name: "pose",
        "geometry_msgs/msg/TransformStamped": "transform",
        "nav_msgs/msg/Odometry": "pose.pose",
        "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose",
    },
    "pose",
)
WRENCH_TARGET = Target(
    WRENCH.name, WRENCH_STAMPED, frozenset({"geometry_msgs/Wrench"}), {WRENCH.name: "wrench"}, "wrench"
)
SCALAR_TARGET = Target(STAMPED_SCALAR, SCALAR_LAYOUTS[STAMPED_SCALAR], NUMBERS, {}, "number")


@dataclass(frozen=True)
class Source:
    """A stream as it was named. key: of NAME.recording.yaml or a parameter; option: of the command line, '' for none.

    text: as given; topic, field (after the first dot) and frame (after the colon) are its parts.
    """

    key: str
    option: str
    text: str

    @property
    def topic(self) -> str:
        """The topic's name, as given."""
        return self.text.partition(":")[0].partition(".")[0]

    @property
    def field(self) -> str:
        """The path of a field, '' if none was named."""
        return self.text.partition(":")[0].partition(".")[2]

    @property
    def frame(self) -> str:
        """The name of a frame, '' if none was named."""
        return self.text.partition(":")[2].strip("/")

    def error(self, path: object, problem: str) -> RecordingError:
        """An error that names the bag ('' for live topics), the key, the option and the value."""
        before, option = f"{path}: " if path else "", f" (option {self.option})" if self.option else ""
        return RecordingError(f"{before}{self.key} {self.text!r}{option}: {problem}")


@dataclass(frozen=True)
class FieldReader:
    """Reads a field of messages of one type as messages of a target's type."""

    target: Target
    type_name: str
    field: str
    definitions: Definitions

    @property
    def timed(self) -> bool:
        """Whether the messages contain their time: a header around the field."""
        return bool(header_path(self.field, self.type_name, self.definitions))

    def read(self, messages: Sequence[bytes], log_times: Sequence[int]) -> list[bytes]:
        """The messages as `messages_as` gives them."""
        return messages_as(self.target, messages, log_times, self.type_name, self.field, self.definitions)


def definitions_of(type_name: str, schemas: Mapping[str, str]) -> Definitions:
    """The definition of a type and of those in it: standard types as they are, others from the bag's text."""
    found = parse_definitions(type_name, schemas[type_name]) if schemas.get(type_name) else {}
    return {**found, **STANDARD}


def field_to_read(source: Source, type_name: str, target: Target, schemas: Mapping[str, str], path: object) -> str:
    """The field of a topic's messages that contains what the target needs.

    Raises RecordingError that names the option, its value, and the fields that are accepted.
    """
    definitions = definitions_of(type_name, schemas)
    if not source.field and (known := target.known.get(type_name)):
        return known
    if source.field and type_at(definitions, type_name, source.field) in target.parts:
        return source.field
    raise source.error(path, _refusal(source, type_name, target, definitions))


def messages_as(
    target: Target,
    messages: Sequence[bytes],
    log_times: Sequence[int],
    type_name: str,
    field: str,
    definitions: Definitions,
) -> list[bytes]:
    """The field of each message as a message of the target's type; b'' where a message is not readable.

    The stamp and frame are those of the nearest header around the field; without one the log time is the stamp.
    """
    header = header_path(field, type_name, definitions)
    converted = [b""] * len(messages)
    tops = [path.partition(".")[0].partition("[")[0] for path in (field, header) if path]
    logged = np.array(log_times, np.uint64).astype(np.int64)
    for block in blocks(messages, type_name, definitions, tops):
        paths = block.paths(field)
        if len(paths) != target.layout.count:  # an index that this message does not have
            continue
        values = np.stack([block.number(path) for path in paths], axis=1)
        stamp, valid = header_stamps(block, header) if header else (logged[block.rows], np.ones(len(values), bool))
        frames = np.array(block.text(f"{header}.frame_id") if header else [""] * len(values))
        for frame in sorted(set(frames[valid].tolist())):
            chosen = valid & (frames == frame)
            encoded = encode(stamp[chosen], values[chosen], target.layout, frame)
            for row, data in zip(block.rows[chosen].tolist(), encoded, strict=True):
                converted[row] = data
    return converted


def header_stamps(block: Block, header: str) -> tuple[IntArray, np.ndarray[tuple[int], np.dtype[np.bool_]]]:
    """Stamps (n,) in ns of the headers at a path, and which of them are valid."""
    seconds, nanoseconds = (block.number(f"{header}.stamp.{part}") for part in ("sec", "nanosec"))
    return seconds.astype(np.int64) * _NANO + nanoseconds.astype(np.int64), nanoseconds < _NANO


def header_path(field: str, type_name: str, definitions: Definitions) -> str:
    """The path of the nearest header around a field, '' without one."""
    parts = field.split(".")[:-1]
    for depth in range(len(parts), -1, -1):
        path = ".".join([*parts[:depth], "header"])
        if type_at(definitions, type_name, path) == "std_msgs/Header":
            return path
    return ""


def _refusal(source: Source, type_name: str, target: Target, definitions: Definitions) -> str:
    what = f"{source.topic} is of type {type_name!r}"
    if type_name == JOINTS and target is not SCALAR_TARGET:
        return f"{what}, which has no pose; take it from /tf and /tf_static: give the frame of the tip, as in /tf:tool0"
    if type_name in TF_TYPES and target is POSE_TARGET:
        return f"{what}, give a frame, as in {source.topic}:block"
    if short_name(type_name) not in definitions:
        known = ", ".join(target.known)
        return f"{what}, and the bag does not contain its definition; accepted types are {known}"
    fields = fields_of_types(definitions, type_name, set(target.parts))
    wrong = f" and has no {target.what} in field {source.field!r}" if source.field else ""
    if not fields:
        accepted = ", ".join(target.known) or "a topic with a number"
        return f"{what}{wrong}; no field of it is a {target.what}, {accepted} is accepted"
    return f"{what}{wrong}, give one of its fields: {', '.join(f'{source.topic}.{field}' for field in fields[:12])}"
