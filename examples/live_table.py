# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The scores on /diagnostics during a replay: a live table in a terminal, lines elsewhere."""

from __future__ import annotations

import sys
import threading
import time
from types import TracebackType

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rich.console import Console
from rich.live import Live
from rich.table import Table

LINE_PERIOD = 2.0  # s between two lines without a terminal
COLUMNS = ("windows", "pushes", "nmse", "nlpd", "coverage 0.95 dx", "coverage 0.95 dy", "coverage 0.95 dtheta")


class LiveTable:
    """A context manager that subscribes to /diagnostics; show() draws the latest values."""

    def __init__(self) -> None:
        self._values: dict[str, dict[str, str]] = {}
        self._last_line = time.monotonic()
        self._live = Live(console=Console(), refresh_per_second=4) if sys.stdout.isatty() else None

    def __enter__(self) -> LiveTable:
        rclpy.init()
        self._node = Node("demo_table")
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._receive, 10)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.show()
        if self._live is not None:
            self._live.stop()
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()
        rclpy.try_shutdown()

    def show(self) -> None:
        """Draw the table, or print a line if the last one is old enough."""
        if self._live is not None:
            self._live.update(self._table())
        elif time.monotonic() - self._last_line > LINE_PERIOD and self._models():
            self._last_line = time.monotonic()
            print("   " + " | ".join(f"{name}: {self._line(name)}" for name in self._models()), flush=True)

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return

    def _receive(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self._values[status.name] = {entry.key: entry.value for entry in status.values}

    def _of(self, subject: str) -> dict[str, str]:
        """The latest values of the status NODE: SUBJECT, whatever the name of the node."""
        return next((values for name, values in self._values.items() if name.endswith(f": {subject}")), {})

    def _models(self) -> list[str]:
        values = self._of("validation")
        return [key.removesuffix(" nmse") for key in values if key.endswith(" nmse")]

    def _line(self, model: str) -> str:
        values = self._of("validation")
        return ", ".join(f"{key} {values.get(f'{model} {key}', '-')}" for key in ("windows", "nmse", "nlpd"))

    def _table(self) -> Table:
        replay = self._of("replay")
        table = Table(title=f"Online validation (99 % of messages at most {replay.get('late_p99_us', '–')} µs late)")
        for column in ("model", *COLUMNS):
            table.add_column(column, justify="right")
        for name in self._models():
            table.add_row(name, *(self._of("validation").get(f"{name} {column}", "-") for column in COLUMNS))
        return table
