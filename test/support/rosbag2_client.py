# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A client made for rosbag2's player: calls services in turn, and prints the answers as JSON.

python rosbag2_client.py PLAYER NAME:JSON_REQUEST ...
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from typing import Any

from ros_harness import call, ros_context
from rosbag2_interfaces import srv


def main() -> None:
    """Call the services and print `[{field: value}, ...]`."""
    player, *words = sys.argv[1:]
    calls = [(name, json.loads(request)) for name, _, request in (word.partition(":") for word in words)]
    with ros_context(int(os.environ["ROS_DOMAIN_ID"])) as node:
        # All clients at once: when one is answered, the replay has discovered the others, and no answer is lost.
        kinds = {name: getattr(srv, name.title().replace("_", "")) for name, _ in calls}
        clients = {name: node.create_client(kind, f"{player}/{name}") for name, kind in kinds.items()}
        answers = [call(clients[name], filled(kinds[name].Request(), request)) for name, request in calls]
    print(json.dumps([{field: getattr(a, field) for field in a.get_fields_and_field_types()} for a in answers]))


def filled(message: Any, values: Mapping[str, Any]) -> Any:
    """The message with these values."""
    for field, value in values.items():
        part = getattr(message, field)
        setattr(message, field, filled(part, value) if isinstance(value, dict) else type(part)(value))
    return message


if __name__ == "__main__":
    main()
