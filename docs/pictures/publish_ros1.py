# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Publish messages from a JSON file in ROS 1, latched: [[topic, type, fields], ...]. Started by draw_rviz.py.

    /usr/bin/python3 docs/pictures/publish_ros1.py MESSAGES.json

It runs in the Python of the Debian packages of ROS 1. Fields that only ROS 2 has are dropped.
"""

import json
import sys

import genpy
import roslib.message
import rospy


def main(path: str) -> None:
    """Publish every message once, and keep it for later subscribers."""
    rospy.init_node("publish_ros1")
    publishers = []
    with open(path) as file:
        messages = json.load(file)
    for topic, type_name, fields in messages:
        kind = roslib.message.get_message_class(type_name)
        message = kind()
        genpy.message.fill_message_args(message, [known(kind, fields)])
        publishers.append(rospy.Publisher("/" + topic, kind, queue_size=1, latch=True))
        publishers[-1].publish(message)
    rospy.spin()


def known(kind, fields):
    """Fields that a message type of ROS 1 has, with those of its parts."""
    found = {}
    for name, declared in zip(kind.__slots__, kind._slot_types, strict=True):
        if name not in fields:  # such as Header.seq
            continue
        part = roslib.message.get_message_class(declared.split("[")[0]) if "/" in declared else None
        if part is None:
            found[name] = fields[name]
        elif "[" in declared:
            found[name] = [known(part, item) for item in fields[name]]
        else:
            found[name] = known(part, fields[name])
    return found


if __name__ == "__main__":
    main(sys.argv[1])
