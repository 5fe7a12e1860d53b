# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rig of a validator or recorder: from a file, or from the topic that a replay publishes it on."""

from __future__ import annotations

from pathlib import Path

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy

from msg_adapters.rigs import rig_from_message
from push_predictor.errors import RigError
from push_predictor.nodes.polling import NoExecutor, not_called, take_all
from push_predictor.nodes.qos import LATCHED
from push_predictor.recordings.rig import Rig, load_rig
from push_predictor_interfaces.msg import PushRig

NO_RIG = "No rig yet: publish it on topic rig, or set the parameter rig."
VOLATILE = "Topic rig has a publisher that is not transient local: nothing is received from it."


class RigSource:
    """The rig of the file `path`, or, if that is empty, the latest on topic rig. Raises RigError for a bad file.

    rig: the same object until another one is published.
    """

    def __init__(self, node: Node, path: str) -> None:
        self._node, self._from_file = node, bool(path)
        self.rig: Rig | None = load_rig(Path(path).expanduser()) if path else None
        self._refusal = ""
        self._subscription = node.create_subscription(PushRig, "rig", not_called, LATCHED, callback_group=NoExecutor())

    @property
    def problem(self) -> str:
        """In words, what is wrong with the topic, empty if nothing."""
        if self._refusal or self.rig is not None:
            return self._refusal
        offered = [each.qos_profile.durability for each in self._node.get_publishers_info_by_topic("rig")]
        return VOLATILE if DurabilityPolicy.VOLATILE in offered else NO_RIG

    @property
    def missing(self) -> str:
        """In words, why there is no rig, empty if there is one."""
        return self.problem if self.rig is None else ""

    def work(self) -> None:
        """Take what was published since the last call, before the samples that came after it."""
        for message, *_ in take_all(self._subscription):
            if self._from_file:
                continue
            try:
                rig, self._refusal = rig_from_message(message, "topic rig"), ""
            except RigError as error:
                self._refusal = str(error)
                continue
            if self.rig is None or rig.to_record() != self.rig.to_record():
                self.rig = rig
