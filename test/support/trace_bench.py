# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A predict_server in a process of its own, and a client of its action trace_residual."""

from __future__ import annotations

import os
import signal
from functools import partial
from pathlib import Path
from typing import Any

import ros_harness as harness
from action_bench import ActionGoal
from made_up_traces import pushes, slippery
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import QoSProfile
from server_bench import Server, server_of
from synthetic import square_rig

from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import train_model
from push_predictor.recordings.rig import save_rig
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import write_table
from push_predictor_interfaces.action import TraceResidual

DRIVERS = ["elapsed_time"]
SLIDING = [0.02, 0.1, 0.8]  # a push along the side, where contact friction matters
RIG = "pushes.rig.yaml"


def recorded(folder: Path, table: PushTable) -> Path:
    """A folder as push_validator leaves it."""
    folder.mkdir(parents=True)
    write_table(folder / "pushes.csv", table)
    save_rig(square_rig(), folder / RIG)
    return folder


def drifting_folder(folder: Path) -> Path:
    """Write a model, and pushes whose contact friction drifts away from it, into the folder; returns it."""
    save_model(train_model(pushes(60, 1), square_rig(), "analytical", name="deployed"), folder / "deployed.pushmodel")
    recorded(folder / "drifting", pushes(60, 2, slippery(0.1)))
    return folder


class TraceServer(Server):
    """A running predict_server, and a client of it and of its action."""

    def __init__(self, process: harness.NodeProcess, node: Node) -> None:
        feedback = QoSProfile(depth=100)
        self._action = ActionClient(node, TraceResidual, "trace_residual", feedback_sub_qos_profile=feedback)
        super().__init__(process, node)

    def trace(
        self, output: Path | str, covariates: list[str] = DRIVERS, model: str = "", data: Path | str = ""
    ) -> Goal:
        goal = TraceResidual.Goal(model=model, covariates=covariates, output=str(output), data=str(data))
        return Goal(self.node, self._action, goal)

    def workers(self) -> list[int]:
        """The processes of traces: children of the node that run what multiprocessing starts."""
        tasks = Path(f"/proc/{self.process.pid}/task").glob("*/children")
        children = [int(pid) for task in tasks for pid in task.read_text().split()]
        return [pid for pid in children if "spawn_main" in Path(f"/proc/{pid}/cmdline").read_text()]

    def held(self) -> int:
        """The process of a trace that has started, stopped: it does not end by itself, however long the test takes."""
        assert harness.wait_until(lambda: bool(self.workers()))
        (worker,) = self.workers()
        os.kill(worker, signal.SIGSTOP)
        return worker


class Goal(ActionGoal):
    """A goal of trace_residual."""

    @property
    def stages(self) -> list[tuple[str, float]]:
        return [(each.stage, each.progress) for each in self.feedback]


def trace_server_of(model: Path, start: Any = partial(harness.node_process, coarse=True), **params: Any) -> Any:
    """A running server; start: `hosted_node` for one in this process."""
    return server_of([model], start, TraceServer, **params)
