# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Where a stream is: a topic, a field of its messages or a frame; the numbers in that field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.message_types import (
    POSE,
    STANDARD,
    WRENCH,
    Definitions,
    fields_of_types,
    parse_definitions,
    short_name,
    type_at,
)
from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.fields.columns import NUMBERS, Block, BlockReader
from push_predictor.types import Array, BoolArray, IntArray

TF_TYPES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
JOINTS = "sensor_msgs/msg/JointState"
SCALAR_FIELDS = {
    "std_msgs/msg/Float64": "data",
    "std_msgs/msg/Float32": "data",
    "sensor_msgs/msg/Temperature": "temperature",
    "sensor_msgs/msg/RelativeHumidity": "relative_humidity",
    "sensor_msgs/msg/FluidPressure": "fluid_pressure",
}
_NANO = 1_000_000_000


@dataclass(frozen=True)
class Target:
    """What a stream needs: the type of its messages in a recording, and types (package/Name) of fields that fit.

    count: of its numbers. known: {message type: field that is read without being named}.
    """

    type: str
    count: int
    parts: frozenset[str]
    known: Mapping[str, str]
    what: str


POSE_TARGET = Target(
    POSE.name,
    7,
    frozenset({"geometry_msgs/Pose", "geometry_msgs/Transform"}),
    {
        POSE.name: "pose",
        "geometry_msgs/msg/TransformStamped": "transform",
        "nav_msgs/msg/Odometry": "pose.pose",
        "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose",
    },
    "pose",
)
WRENCH_TARGET = Target(WRENCH.name, 6, frozenset({"geometry_msgs/Wrench"}), {WRENCH.name: "wrench"}, "wrench")
SCALAR_TARGET = Target("", 1, NUMBERS, SCALAR_FIELDS, "number")


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

    def frame_fits(self, may_have: bool) -> bool:
        """Whether there is no colon, or a frame after it where the stream may have one."""
        return ":" not in self.text or (may_have and bool(self.frame))

    def check_type(self, kind: str, path: object) -> None:
        """Raise RecordingError for a frame in a topic of a type without frames."""
        if self.frame and kind not in TF_TYPES:
            raise self.error(path, f"{self.topic} is of type {kind!r}; only {TF_TYPES[0]} has frames")

    def error(self, path: object, problem: str) -> RecordingError:
        """An error that names the bag ('' for live topics), the key, the option and the value."""
        before, option = (f"{path}: ", f" (option {self.option})") if path else ("", "")
        return RecordingError(f"{before}{self.key} {self.text!r}{option}: {problem}")


@dataclass(frozen=True, eq=False)
class Columns:
    """n decoded messages.

    stamp (n,) in ns: of the nearest header around the field, else when the message was logged or sent. values (n, k).
    valid (n,): readable. frame (n,): number of the frame that the header names among `frames`.
    """

    stamp: IntArray
    values: Array
    valid: BoolArray
    frame: IntArray
    frames: tuple[str, ...]

    @property
    def named(self) -> frozenset[str]:
        """The frames of readable messages."""
        return frozenset(self.frames[k] for k in np.unique(self.frame[self.valid]).tolist())

    def frame_names(self) -> NDArray[np.str_]:
        """The frame (n,) of each, without the slashes around it."""
        return np.array([name.strip("/") for name in self.frames])[self.frame]

    def rows(self, which: BoolArray | slice) -> Columns:
        """Some of the messages."""
        return Columns(self.stamp[which], self.values[which], self.valid[which], self.frame[which], self.frames)


class FieldReader:
    """Reads a field of messages of one type as what a stream needs. timed: whether a header is around the field.

    from_log: the stamps are the times of the messages, whatever their headers state.
    """

    def __init__(
        self, target: Target, type_name: str, field: str, definitions: Definitions, from_log: bool = False
    ) -> None:
        self._target, self._field, self._from_log = target, field, from_log
        self._header = header_path(field, type_name, definitions)
        self.timed = bool(self._header)
        self._blocks = BlockReader(type_name, definitions, (field, self._header))

    def read(self, messages: Messages) -> Columns:
        """The columns of n messages; one that is not readable has zeros."""
        n, frames = len(messages), {"": 0}
        stamp, values = messages.times.copy(), np.zeros((n, self._target.count))
        valid, frame = np.zeros(n, np.bool_), np.zeros(n, np.int64)
        for block in self._blocks.blocks(messages):
            paths = block.paths(self._field)
            if len(paths) != self._target.count:  # an index that this message does not have
                continue
            rows = block.rows
            values[rows], valid[rows] = block.numbers(paths), True
            if self._header:
                if not self._from_log:
                    stamp[rows], valid[rows] = header_stamps(block, self._header)
                names, number = block.text(f"{self._header}.frame_id")
                frame[rows] = np.array([frames.setdefault(name, len(frames)) for name in names])[number]
        return Columns(stamp, values, valid, frame, tuple(frames))


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


def header_stamps(block: Block, header: str) -> tuple[IntArray, BoolArray]:
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
