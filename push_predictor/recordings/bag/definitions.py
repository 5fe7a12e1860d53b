# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The message types of a recording: definition text, hash, byte layout."""

from __future__ import annotations

from dataclasses import dataclass

from push_predictor.recordings.bag.cdr import Layout

_RULE = "=" * 80
HEADER_DEFINITION = f"""{_RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_XYZ = "float64 x\nfloat64 y\nfloat64 z\n"


@dataclass(frozen=True)
class MessageType:
    """name: package/msg/Name; definition: ros2msg text with all referenced types; type_hash: REP 2016."""

    name: str
    definition: str
    type_hash: str


POSE = MessageType(
    "geometry_msgs/msg/PoseStamped",
    f"""std_msgs/Header header
geometry_msgs/Pose pose
{_RULE}
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
{_RULE}
MSG: geometry_msgs/Point
{_XYZ}{_RULE}
MSG: geometry_msgs/Quaternion
float64 x 0
float64 y 0
float64 z 0
float64 w 1
{HEADER_DEFINITION}""",
    "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
)
WRENCH = MessageType(
    "geometry_msgs/msg/WrenchStamped",
    f"""std_msgs/Header header
geometry_msgs/Wrench wrench
{_RULE}
MSG: geometry_msgs/Wrench
geometry_msgs/Vector3 force
geometry_msgs/Vector3 torque
{_RULE}
MSG: geometry_msgs/Vector3
{_XYZ}{HEADER_DEFINITION}""",
    "RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77",
)
FLOAT64 = MessageType(
    "std_msgs/msg/Float64",
    "float64 data\n",
    "RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a",
)

SCALAR_LAYOUTS = {
    FLOAT64.name: Layout(header=False, count=1),
    "std_msgs/msg/Float32": Layout(header=False, count=1, size=4),
    "sensor_msgs/msg/Temperature": Layout(header=True, count=1),
    "sensor_msgs/msg/RelativeHumidity": Layout(header=True, count=1),
    "sensor_msgs/msg/FluidPressure": Layout(header=True, count=1),
}
