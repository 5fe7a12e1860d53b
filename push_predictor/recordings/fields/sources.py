# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Where a stream is: a topic, a field of its messages or a frame; the numbers in that field."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.message_types import (
    POSE,
    STANDARD,
    WRENCH,
    Definitions,
    Step,
    fields_of_types,
    parse_definitions,
    short_name,
    steps_of,
    type_at,
)
from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.fields.columns import NUMBERS, Block, BlockReader, element_names, places_of
from push_predictor.recordings.fields.pose_rows import pose_rows_of
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
MOST_NAMES = 12  # elements that a refusal lists
_NANO = 1_000_000_000


def _arrays(length: int | str) -> tuple[str, str]:
    """The types of arrays of numbers of a length, '' for any."""
    return f"float64[{length}]", f"float32[{length}]"


@dataclass(frozen=True)
class Target:
    """What a stream needs: the type of its messages in a recording, and types (package/Name) of fields that fit.

    count: of its numbers. known: {message type: field that is read without being named}. pieces: the types of two
    fields that fit together in any order, as A+B.
    """

    type: str
    count: int
    parts: frozenset[str]
    known: Mapping[str, str]
    what: str
    pieces: tuple[frozenset[str], frozenset[str]] = (frozenset(), frozenset())

    def fits(self, types: Sequence[str | None]) -> bool:
        """Whether fields of these types contain what the stream needs."""
        if len(types) == 1:
            return types[0] in self.parts
        orders = (types, types[::-1]) if len(types) == 2 else ()
        return any(one in self.pieces[0] and other in self.pieces[1] for one, other in orders)


POSE_TARGET = Target(
    POSE.name,
    7,
    frozenset({"geometry_msgs/Pose", "geometry_msgs/Transform", *_arrays(16), *_arrays(12), *_arrays("")}),
    {
        POSE.name: "pose",
        "geometry_msgs/msg/TransformStamped": "transform",
        "nav_msgs/msg/Odometry": "pose.pose",
        "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose",
        "geometry_msgs/msg/Pose": "position+orientation",
        "geometry_msgs/msg/Transform": "translation+rotation",
    },
    "pose",
    (
        frozenset({"geometry_msgs/Point", "geometry_msgs/Vector3", *_arrays(3)}),
        frozenset({"geometry_msgs/Quaternion", *_arrays(9)}),
    ),
)
WRENCH_TARGET = Target(
    WRENCH.name,
    6,
    frozenset({"geometry_msgs/Wrench"}),
    {WRENCH.name: "wrench", "geometry_msgs/msg/Wrench": "force+torque"},
    "wrench",
    (frozenset({"geometry_msgs/Vector3"}), frozenset({"geometry_msgs/Vector3"})),
)
SCALAR_TARGET = Target("", 1, NUMBERS, SCALAR_FIELDS, "number")


@dataclass(frozen=True)
class Source:
    """A stream as it was named, or another text that says how to read it.

    key: of NAME.recording.yaml, and of a parameter. text: as given; topic, field (after the first dot) and frame (after
    the colon) are its parts.
    """

    key: str
    text: str

    @property
    def option(self) -> str:
        """The option of the command line, which names one topic at a time."""
        return f"--{self.key.replace('topics', 'topic').replace('_', '-')}"

    @property
    def topic(self) -> str:
        """The topic's name, as given."""
        return re.split("[.:]", self.text, maxsplit=1)[0]

    @property
    def field(self) -> str:
        """The path of a field, '' if none was named."""
        rest = self.text[len(self.topic) :]
        return rest[1:] if rest.startswith(".") else ""

    @property
    def frame(self) -> str:
        """The name of a frame, '' if none was named."""
        return "" if self.field else self.text.partition(":")[2].strip("/")

    def frame_fits(self, may_have: bool) -> bool:
        """Whether there is no colon, or a frame after it where the stream may have one."""
        return ":" not in self.text or bool(self.field) or (may_have and bool(self.frame))

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
    valid (n,): readable. absent (n,): readable, but without the chosen element, or with a matrix that is no pose.
    frame (n,): that the header names, without the slashes around it.
    """

    stamp: IntArray
    values: Array
    valid: BoolArray
    absent: BoolArray
    frame: NDArray[np.object_]

    @classmethod
    def unread(cls, times: IntArray, count: int) -> Columns:
        """Messages of which nothing is known but their times (n,) ns; count: of their numbers."""
        valid, absent = np.zeros((2, len(times)), np.bool_)
        return cls(times.copy(), np.zeros((len(times), count)), valid, absent, np.full(len(times), "", np.object_))

    def __len__(self) -> int:
        return len(self.stamp)

    @property
    def named(self) -> frozenset[str]:
        """The frames of readable messages."""
        return frozenset(self.frame[self.valid].tolist())


class FieldReader:
    """Reads a field of messages of one type as what a stream needs. timed: whether a header is around the field.

    from_log: the stamps are the times of the messages, whatever their headers state. names: of elements, where one is
    chosen by its name and some message lacks it.
    """

    def __init__(
        self, target: Target, type_name: str, field: str, definitions: Definitions, from_log: bool = False
    ) -> None:
        self._target, self._from_log = target, from_log
        self._fields = [steps_of(each) for each in fields_in(field)]
        header = header_path(fields_in(field)[0], type_name, definitions)
        self._header = steps_of(header)
        self.timed = bool(header)
        self._blocks = BlockReader(type_name, definitions, (*fields_in(field), header))
        self.names: set[str] = set()

    def read(self, messages: Messages) -> Columns:
        """The columns of n messages; one that is not valid has zeros."""
        found = Columns.unread(messages.times, self._target.count)
        for block in self._blocks.blocks(messages):
            found.absent[block.rows] = True
            for steps, which in places_of(block, self._fields[0]):
                self._fill(found, block.where(which), steps)
            if found.absent[block.rows].all() and len(self.names) < MOST_NAMES:
                self.names |= element_names(block, self._fields[0])
        return found

    def _fill(self, columns: Columns, block: Block, first: Sequence[str]) -> None:
        """Fill the rows of a block; first: the steps of the first field."""
        if (found := self._numbers(block, first)) is None:
            return
        rows = block.rows
        columns.values[rows], columns.absent[rows] = found
        columns.valid[rows] = ~columns.absent[rows]
        if not self.timed:
            return
        # The fields before the header are those before the field, with the same element.
        header = ".".join([*first[: len(self._header) - 1], "header"])
        if not self._from_log:
            columns.stamp[rows], sound = header_stamps(block, header)
            columns.valid[rows] &= sound
        names, number = block.text(f"{header}.frame_id")
        columns.frame[rows] = np.array([name.strip("/") for name in names], np.object_)[number]

    def _numbers(self, block: Block, first: Sequence[str]) -> tuple[Array, BoolArray] | None:
        """The numbers (n, count) of the fields, and which rows are a matrix that is no pose; None without the fields.

        first: the steps of the first field.
        """
        paths = [block.paths(".".join(self._found(steps, first))) for steps in self._fields]
        if not all(paths):
            return None
        parts = [block.numbers(each) for each in paths]
        found = pose_rows_of(parts) if self._target is POSE_TARGET else np.hstack(parts)
        if found is None or found.shape[1] != self._target.count:
            return None
        unfit = np.isnan(found[:, 0])
        if unfit.any():
            unfit &= np.isnan(found).all(axis=1) & np.isfinite(np.hstack(parts)).all(axis=1)
        return found, np.asarray(unfit)

    def _found(self, steps: Sequence[Step], first: Sequence[str]) -> list[str]:
        """The steps of a field, with the elements that were chosen for the first field."""
        same = [step for step, other in zip(steps, self._fields[0], strict=False) if step == other]
        return [*first[: len(same)], *(step.text for step in steps[len(same) :])]


def fields_in(text: str) -> list[str]:
    """The fields in A+B, of another text itself."""
    return re.split(r"\+(?![^\[]*\])", text)


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
    if source.field and target.fits([type_at(definitions, type_name, each) for each in fields_in(source.field)]):
        return source.field
    raise source.error(path, _refusal(source, type_name, target, definitions))


def header_stamps(block: Block, header: str) -> tuple[IntArray, BoolArray]:
    """Stamps (n,) in ns of the headers at a path, and which of them are valid."""
    seconds, nanoseconds = (block.number(f"{header}.stamp.{part}") for part in ("sec", "nanosec"))
    return seconds.astype(np.int64) * _NANO + nanoseconds.astype(np.int64), nanoseconds < _NANO


def header_path(field: str, type_name: str, definitions: Definitions) -> str:
    """The path of the nearest header around a field, '' without one."""
    parts = [step.text for step in steps_of(field)[:-1]]
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
    fields = fields_of_types(definitions, type_name, {each for each in target.parts if not each.endswith("[]")})
    wrong = f" and has no {target.what} in field {source.field!r}" if source.field else ""
    if not fields:
        accepted = ", ".join(target.known) or "a topic with a number"
        return f"{what}{wrong}; no field of it is a {target.what}, {accepted} is accepted"
    listed = ", ".join(f"{source.topic}.{field}" for field in fields[:12])
    named = [field.replace("[0]", "[NAME]", 1) for field in fields if "[0]" in field]
    named = [field for field in named if type_at(definitions, type_name, field)]
    by_name = f"; {source.topic}.{named[0]} chooses the element with this name" if named else ""
    return f"{what}{wrong}, give one of its fields: {listed}{by_name}"
