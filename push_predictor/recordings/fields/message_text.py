# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Definitions of message types, parsed from `ros2msg` text."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

_LINE = re.compile(r"^([\w/]+)(?:<=\d+)?(\[(?:<=)?\d*\])?\s+(\w+)\s*(.*)$")
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


def type_at(definitions: Mapping[str, tuple[Field, ...]], type_name: str, path: str) -> str | None:
    """The type of one value at a field path such as `pose.pose` or `poses[0]`, None if there is no such field."""
    name = short_name(type_name)
    for part in path.split("."):
        step, _, index = part.partition("[")
        field = next((field for field in definitions.get(name, ()) if field.name == step), None)
        if field is None or (field.array is None) != (not index) or (index and not re.fullmatch(r"\d+\]", index)):
            return None
        name = field.type
    return name


def _paths(
    definitions: Mapping[str, tuple[Field, ...]], name: str, wanted: set[str], prefix: str, depth: int
) -> Iterator[str]:
    for field in definitions.get(name, ()) if depth else ():
        path = f"{prefix}{field.name}{'' if field.array is None else '[0]'}"
        if field.type in wanted:
            yield path
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


_POSE = "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
_XYZ = "float64 x\nfloat64 y\nfloat64 z\n"
_STANDARD = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Point": _XYZ,
    "geometry_msgs/Vector3": _XYZ,
    "geometry_msgs/Quaternion": f"{_XYZ}float64 w\n",
    "geometry_msgs/Pose": _POSE,
    "geometry_msgs/PoseStamped": "Header header\nPose pose\n",
    "geometry_msgs/PoseWithCovariance": "Pose pose\nfloat64[36] covariance\n",
    "geometry_msgs/PoseWithCovarianceStamped": "Header header\nPoseWithCovariance pose\n",
    "geometry_msgs/Transform": "Vector3 translation\nQuaternion rotation\n",
    "geometry_msgs/TransformStamped": "Header header\nstring child_frame_id\nTransform transform\n",
    "geometry_msgs/Twist": "Vector3 linear\nVector3 angular\n",
    "geometry_msgs/TwistWithCovariance": "Twist twist\nfloat64[36] covariance\n",
    "geometry_msgs/Wrench": "Vector3 force\nVector3 torque\n",
    "geometry_msgs/WrenchStamped": "Header header\nWrench wrench\n",
    "nav_msgs/Odometry": "Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
    "geometry_msgs/TwistWithCovariance twist\n",
    "std_msgs/Float64": "float64 data\n",
    "std_msgs/Float32": "float32 data\n",
    "sensor_msgs/Temperature": "Header header\nfloat64 temperature\nfloat64 variance\n",
    "sensor_msgs/RelativeHumidity": "Header header\nfloat64 relative_humidity\nfloat64 variance\n",
    "sensor_msgs/FluidPressure": "Header header\nfloat64 fluid_pressure\nfloat64 variance\n",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "tf/tfMessage": "geometry_msgs/TransformStamped[] transforms\n",
}
# Bags of older rosbag2 have no definitions; those of these types never change.
STANDARD: Definitions = {name: tuple(_fields(text, name.partition("/")[0])) for name, text in _STANDARD.items()}
