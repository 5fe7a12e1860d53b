# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rig of a validator: from a file, or from the topic that a replay publishes it on."""

from __future__ import annotations

from pathlib import Path

from rclpy.node import Node
from std_msgs.msg import String

from push_predictor.errors import RigError
from push_predictor.nodes.polling import PolledGroup, take_all
from push_predictor.nodes.qos import LATCHED
from push_predictor.recordings.rig import Rig, load_rig, rig_from_json


class RigSource:
    """The rig of the file `path`, or, if that is empty, the latest on topic rig. Raises RigError for a bad file."""

    def __init__(self, node: Node, path: str) -> None:
        self.rig: Rig | None = load_rig(Path(path).expanduser()) if path else None
        self.problem = "" if path else "No rig yet: publish it on topic rig, or set the parameter rig."
        self._from_file = bool(path)
        self._subscription = node.create_subscription(
            String, "rig", self._take, LATCHED, callback_group=PolledGroup()
        )  # not called by the executor: work() takes the messages

    @property
    def missing(self) -> str:
        """In words, why there is no rig, empty if there is one."""
        return self.problem if self.rig is None else ""

    def differs_from(self, earlier: Rig) -> bool:
        """Whether the rig is known and differs from an earlier one."""
        return self.rig is not None and self.rig is not earlier and self.rig.to_record() != earlier.to_record()

    def work(self) -> None:
        """Take what was published since the last call."""
        for message, *_ in take_all(self._subscription):
            self._take(message)

    def _take(self, message: String) -> None:
        if self._from_file:
            return
        try:
            self.rig, self.problem = rig_from_json(message.data, "topic rig"), ""
        except RigError as error:
            self.problem = str(error)
