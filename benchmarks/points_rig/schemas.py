# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ros2msg definitions of the message types in the bags."""

_PARTS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
}
_STAMPED = ("std_msgs/Header", "builtin_interfaces/Time")


def _definition(text: str, *parts: str) -> str:
    """A message definition followed by those of the types it uses."""
    return text + "".join(f"{'=' * 80}\nMSG: {part}\n{_PARTS[part]}" for part in parts)


_POSE_PARTS = (*_STAMPED, "geometry_msgs/Pose", "geometry_msgs/Point", "geometry_msgs/Quaternion")
_WRENCH_PARTS = (*_STAMPED, "geometry_msgs/Wrench", "geometry_msgs/Vector3")
DEFINITIONS = {
    "geometry_msgs/msg/PoseStamped": _definition("std_msgs/Header header\ngeometry_msgs/Pose pose\n", *_POSE_PARTS),
    "geometry_msgs/msg/WrenchStamped": _definition(
        "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n", *_WRENCH_PARTS
    ),
    "std_msgs/msg/Float64": "float64 data\n",
}
