# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Message types and their definitions: `ros2msg` text of standard and installed types or of IDL, the fields in it."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from push_predictor.errors import RecordingError

_RULE = "=" * 80
_LINE = re.compile(r"^([\w/]+)(?:<=\d+)?(\[(?:<=)?\d*\])?\s+(\w+)\s*(.*)$")
_STEP = re.compile(r"(\w+)(?:\[([^\]]*)\])?(?:\.|$)")
_DEEPEST = 8  # levels of nested types that are searched


@dataclass(frozen=True)
class Field:
    """A field of a message. array: None for one value, 0 for a sequence, else the length of a fixed array."""

    type: str
    name: str
    array: int | None = None


Definitions = dict[str, tuple[Field, ...]]


def parse_definitions(type_name: str, text: str) -> Definitions:
    """{package/Name: fields} of a type and of all types that its `ros2msg` text contains."""
    found: Definitions = {}
    parts = re.split(r"^=+\s*\nMSG: *(\S+) *$", text, flags=re.MULTILINE)
    for name, part in zip([type_name, *parts[1::2]], parts[::2], strict=True):
        name = short_name(name)
        found[name] = tuple(_fields(part, name.partition("/")[0]))
    return found


def short_name(type_name: str) -> str:
    """package/Name of package/msg/Name."""
    return type_name.replace("/msg/", "/")


def fields_of_types(definitions: Mapping[str, tuple[Field, ...]], type_name: str, wanted: set[str]) -> list[str]:
    """The paths of all fields of the wanted types (package/Name), a sequence's as its first element."""
    return list(_paths(definitions, short_name(type_name), wanted, "", _DEEPEST))


class Step(NamedTuple):
    """A step of a field path: the name of a field, and what is in the brackets after it, None without brackets."""

    name: str
    choice: str | None

    @property
    def text(self) -> str:
        """As it was written."""
        return self.name if self.choice is None else f"{self.name}[{self.choice}]"

    @property
    def chooses(self) -> bool:
        """Whether an element is chosen by what is in it, not by its number."""
        return self.choice is not None and not self.choice.isdecimal()


def steps_of(path: str) -> list[Step]:
    """The steps of a field path such as `poses[0]` or `bodies[name=block].pose`; none if it is no path."""
    found, at = list[Step](), 0
    while at < len(path):
        if (step := _STEP.match(path, at)) is None:
            return []
        found.append(Step(step[1], step[2]))
        at = step.end()
    return [] if path.endswith(".") else found


def type_at(definitions: Mapping[str, tuple[Field, ...]], type_name: str, path: str) -> str | None:
    """The type of the value at a field path, of a whole array as in `float64[16]`; None if there is no such field."""
    name, steps = short_name(type_name), steps_of(path)
    for number, step in enumerate(steps, start=1):
        field = next((field for field in definitions.get(name, ()) if field.name == step.name), None)
        if field is None or (field.array is None and step.choice is not None):
            return None
        if field.array is not None and step.choice is None:
            return f"{field.type}[{field.array or ''}]" if number == len(steps) else None
        if step.chooses and not _can_choose(definitions, field.type, str(step.choice)):
            return None
        name = field.type
    return name if steps else None


def _can_choose(definitions: Mapping[str, tuple[Field, ...]], element: str, choice: str) -> bool:
    """Whether elements of a type contain what a choice names: KEY=VALUE, or any text."""
    key, given, _ = choice.partition("=")
    if given:
        return not {"/", "["} & {*(type_at(definitions, element, key) or "/")}
    return bool(choice) and has_text(definitions, element)


def has_text(definitions: Mapping[str, tuple[Field, ...]], type_name: str, depth: int = _DEEPEST) -> bool:
    """Whether a type has a text, but for those in arrays."""
    fields = [field for field in definitions.get(type_name, ()) if field.array is None] if depth else []
    return any(field.type == "string" or has_text(definitions, field.type, depth - 1) for field in fields)


def _paths(
    definitions: Mapping[str, tuple[Field, ...]], name: str, wanted: set[str], prefix: str, depth: int
) -> Iterator[str]:
    for field in definitions.get(name, ()) if depth else ():
        path = f"{prefix}{field.name}{'' if field.array is None else '[0]'}"
        if field.type in wanted:
            yield path
        elif f"{field.type}[{field.array}]" in wanted:
            yield f"{prefix}{field.name}"
        else:
            yield from _paths(definitions, field.type, wanted, f"{path}.", depth - 1)


def _fields(text: str, package: str) -> Iterator[Field]:
    for line in text.splitlines():
        found = _LINE.match(line.partition("#")[0].strip())
        if not found or found[4].startswith("="):  # blank, or a constant
            continue
        kind = short_name(found[1])
        if kind == "Header":
            kind = "std_msgs/Header"
        elif kind[0].isupper():
            kind = f"{package}/{kind}"
        array = None if found[2] is None else int(found[2].strip("[]")) if found[2][1:-1].isdigit() else 0
        yield Field(kind, found[3], array)


def definition_text(type_name: str, shares: Sequence[Path] | None = None) -> str:
    """The `ros2msg` text of a type such as std_msgs/msg/Header, followed by those of all types in it.

    shares: folders with PACKAGE/msg/NAME.msg; those of the ROS installation by default. Raises RecordingError that
    names the missing file and where it was looked for.
    """
    places = _installed() if shares is None else shares
    return _with_types(short_name(type_name), lambda name: _installed_text(name, places))


def _with_types(type_name: str, text_of: Callable[[str], str]) -> str:
    """The definition of a type (package/Name), and after it each type in it once."""
    texts: dict[str, str] = {}
    waiting = [type_name]
    while waiting:
        name = waiting.pop(0)
        if name not in texts:
            texts[name] = text_of(name)
            package = name.partition("/")[0]
            waiting += [field.type for field in _fields(texts[name], package) if "/" in field.type]
    return f"{_RULE}\n".join(text if name == type_name else f"MSG: {name}\n{text}" for name, text in texts.items())


def _installed() -> list[Path]:
    prefixes = filter(None, [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix])
    return [Path(prefix) / "share" for prefix in dict.fromkeys(prefixes)]


def _installed_text(type_name: str, shares: Sequence[Path]) -> str:
    package, _, name = type_name.partition("/")
    for share in shares:
        file = share / package / "msg" / f"{name}.msg"
        if file.is_file():
            try:
                return file.read_text(encoding="utf-8").rstrip("\n") + "\n"
            except (OSError, UnicodeDecodeError) as error:
                raise RecordingError(f"{file} cannot be read: {error}") from error
    raise RecordingError(f"{package}/msg/{name}.msg: not found in {', '.join(map(str, shares))}")


@dataclass(frozen=True)
class MessageType:
    """name: package/msg/Name; definition: ros2msg text with all referenced types; type_hash: REP 2016."""

    name: str
    definition: str
    type_hash: str


_HEADER = "std_msgs/Header header\n"
_XYZ = "float64 x\nfloat64 y\nfloat64 z\n"
_STANDARD = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Point": _XYZ,
    "geometry_msgs/Vector3": _XYZ,
    "geometry_msgs/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "geometry_msgs/PoseStamped": f"{_HEADER}geometry_msgs/Pose pose\n",
    "geometry_msgs/PoseWithCovariance": "Pose pose\nfloat64[36] covariance\n",
    "geometry_msgs/PoseWithCovarianceStamped": f"{_HEADER}PoseWithCovariance pose\n",
    "geometry_msgs/Transform": "Vector3 translation\nQuaternion rotation\n",
    "geometry_msgs/TransformStamped": f"{_HEADER}string child_frame_id\nTransform transform\n",
    "geometry_msgs/Twist": "Vector3 linear\nVector3 angular\n",
    "geometry_msgs/TwistWithCovariance": "Twist twist\nfloat64[36] covariance\n",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
    "geometry_msgs/WrenchStamped": f"{_HEADER}geometry_msgs/Wrench wrench\n",
    "nav_msgs/Odometry": f"{_HEADER}string child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
    "geometry_msgs/TwistWithCovariance twist\n",
    "std_msgs/Float64": "float64 data\n",
    "std_msgs/Float32": "float32 data\n",
    "sensor_msgs/Temperature": f"{_HEADER}float64 temperature\nfloat64 variance\n",
    "sensor_msgs/RelativeHumidity": f"{_HEADER}float64 relative_humidity\nfloat64 variance\n",
    "sensor_msgs/FluidPressure": f"{_HEADER}float64 fluid_pressure\nfloat64 variance\n",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "tf/tfMessage": "geometry_msgs/TransformStamped[] transforms\n",
}
# Bags of older rosbag2 have no definitions; those of these types never change.
STANDARD: Definitions = {name: tuple(_fields(text, name.partition("/")[0])) for name, text in _STANDARD.items()}


def _standard(name: str, type_hash: str) -> MessageType:
    return MessageType(name, _with_types(short_name(name), _STANDARD.__getitem__), f"RIHS01_{type_hash}")


POSE = _standard("geometry_msgs/msg/PoseStamped", "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8")
WRENCH = _standard(
    "geometry_msgs/msg/WrenchStamped", "8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77"
)
FLOAT64 = _standard("std_msgs/msg/Float64", "705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a")


# --- IDL (schema encoding `ros2idl`), which rosbag2 records where a type has no .msg ----------------------------------

_IDL_SECTION = re.compile(r"^=+\s*\nIDL: *(\S+) *$", re.MULTILINE)
_IDL_NOT_READ = re.compile(
    r"//[^\n]*|/\*.*?\*/|#[^\n]*|@\w+\s*(?:\((?:[^()\"]|\"(?:\\.|[^\"\\])*\")*\))?", re.DOTALL
)  # comments, includes and annotations
_IDL_TYPEDEF = re.compile(r"typedef\s+([^;]+?)\s+(\w+)((?:\[\d+\])?)\s*;")
_IDL_STRUCT = re.compile(r"struct\s+(\w+)\s*\{(.*?)\}", re.DOTALL)
_IDL_MEMBER = re.compile(r"\s*(.+?)\s+(\w+)\s*((?:\[\d+\])?)\s*$", re.DOTALL)
_IDL_SEQUENCE = re.compile(r"sequence\s*<\s*(.+?)\s*(?:,\s*\d+\s*)?>")
_IDL_NUMBERS = {
    "double": "float64",
    "float": "float32",
    "boolean": "bool",
    "octet": "byte",
    "short": "int16",
    "unsigned short": "uint16",
    "long": "int32",
    "unsigned long": "uint32",
    "long long": "int64",
    "unsigned long long": "uint64",
}


def msg_of_idl(text: str) -> str:
    """The `ros2msg` text of IDL text, whose first section is the type itself; '' if there is no section."""
    _, *parts = _IDL_SECTION.split(text)
    found = [(name, _idl_fields(name, part)) for name, part in zip(parts[::2], parts[1::2], strict=True)]
    return f"{_RULE}\n".join(fields if k == 0 else f"MSG: {name}\n{fields}" for k, (name, fields) in enumerate(found))


def _idl_fields(type_name: str, text: str) -> str:
    """One line for each member of the struct of a type, '' without it."""
    plain = _IDL_NOT_READ.sub(" ", text)
    aliases = {alias: (_idl_type(kind), length) for kind, alias, length in _IDL_TYPEDEF.findall(plain)}
    members = next((body for name, body in _IDL_STRUCT.findall(plain) if name == type_name.rpartition("/")[2]), "")
    lines = []
    for member in filter(None, map(_IDL_MEMBER.match, members.split(";"))):
        kind, name, length = member.groups()
        kind, own = aliases.get(kind, (_idl_type(kind), ""))
        lines.append(f"{kind}{own or length} {name}\n")
    return "".join(lines)


def _idl_type(text: str) -> str:
    """The type of `ros2msg`, of a sequence with brackets."""
    if sequence := _IDL_SEQUENCE.fullmatch(text.strip()):
        return f"{_idl_type(sequence[1])}[]"
    name = " ".join(text.split())
    if re.fullmatch(r"w?string(\s*<\s*\d+\s*>)?", name):
        return name.partition("<")[0].strip()
    return _IDL_NUMBERS.get(name, name.replace("::msg::", "/").replace("::", "/"))
