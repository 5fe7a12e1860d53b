# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A second node for the services of a node whose names already have another type."""

from __future__ import annotations

import threading

from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter


class CompanionNode:
    """A hidden node in a DDS participant and a thread of its own.

    One participant refuses a second type under one name; two participants of a process may have one each, and every
    client is answered by the one whose type it has. Domain and enclave are those of `principal`.
    """

    def __init__(self, principal: Node, suffix: str) -> None:
        self._context = Context()
        self._context.init(
            args=["--ros-args", "--enclave", _enclave(principal)], domain_id=principal.context.get_domain_id()
        )
        self.node = Node(
            f"_{principal.get_name()}_{suffix}",
            namespace=principal.get_namespace(),
            context=self._context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
            parameter_overrides=[Parameter("start_type_description_service", value=False)],
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._spin, name=suffix)

    def start(self) -> None:
        """Answer requests from now on."""
        self._thread.start()

    def close(self) -> None:
        """End the thread and destroy the node."""
        self._closing.set()
        # A task wakes the thread. The executor is shut down afterwards: rclpy raises in a thread that still waits.
        self._executor.create_task(lambda: None)
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def _spin(self) -> None:
        while not self._closing.is_set():
            self._executor.spin_once()


def _enclave(node: Node) -> str:
    own = (node.get_name(), node.get_namespace())
    listed = node.get_node_names_and_namespaces_with_enclaves()
    return next((enclave for name, namespace, enclave in listed if (name, namespace) == own), "/")
