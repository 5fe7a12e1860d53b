# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A predict_server in a separate process and a client for it, shared by the benchmarks of its services."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile

from push_predictor.blas_threads import VARIABLES
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.tabulated_model import outside_pushes
from push_predictor_interfaces.srv import PredictPush

DEPTH = QoSProfile(depth=100)


class Caller:
    """Calls services one at a time and receives /diagnostics."""

    def __init__(self) -> None:
        self.node = Node("benchmark_client")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.diagnostics: dict[str, dict[str, str]] = {}  # by the name of the status
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._receive, 10)

    def client(self, kind: Any, name: str) -> Client:
        """A client of a service. Raises SystemExit if the service does not appear."""
        client = self.node.create_client(kind, name, qos_profile=DEPTH)
        if not client.wait_for_service(30.0):
            raise SystemExit(f"{client.srv_name}: the service did not appear within 30 s")
        return client

    def timed(self, client: Client, request: Any) -> tuple[float, Any]:
        """Seconds from call to response, and the response. Raises SystemExit if the request is refused."""
        start = perf_counter()
        future = client.call_async(request)
        self.spin_until(future.done)
        elapsed = perf_counter() - start
        response = future.result()
        if response is None or (hasattr(response, "mean") and not response.success):
            raise SystemExit(f"{client.srv_name} refused: {response and response.message}")
        return elapsed, response

    def spin_until(self, condition: Callable[[], bool], seconds: float = 60.0) -> None:
        """Process messages until the condition is true. Raises SystemExit after `seconds`."""
        end = perf_counter() + seconds
        while not condition():  # spin_until_future_complete would leave tasks behind, and slow down
            if perf_counter() > end:
                raise SystemExit(f"no response within {seconds:g} s")
            self.executor.spin_once(timeout_sec=seconds)

    def reported(self, node_name: str) -> dict[str, str]:
        """The next diagnostic status of the node whose fully qualified name begins with that name."""
        self.diagnostics.clear()
        self.spin_until(lambda: any(name.startswith(node_name) for name in self.diagnostics), 10.0)
        return next(values for name, values in self.diagnostics.items() if name.startswith(node_name))

    def _receive(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.diagnostics[status.name] = {pair.key: pair.value for pair in status.values}


@contextmanager
def graph(domain: int) -> Iterator[None]:
    """Initialise ROS for this process and its children, on this machine only."""
    os.environ.update(ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST")
    rclpy.init()
    try:
        yield
    finally:
        rclpy.try_shutdown()


@contextmanager
def caller() -> Iterator[Caller]:
    """A node that calls services."""
    made = Caller()
    try:
        yield made
    finally:
        made.executor.shutdown()
        made.node.destroy_node()


@contextmanager
def predict_server(model: Path, namespace: str = "") -> Iterator[int]:
    """Run a predict_server with one model; yields its process id."""
    names = ["-r", f"__ns:={namespace}"] if namespace else []
    arguments = ["--ros-args", "-p", f"models:=['{model}']", *names]
    with process("-m", "push_predictor.nodes.predict_server", *arguments) as number:
        yield number


def environment_of(**given: str) -> dict[str, str]:
    """The environment of another Python with this repository's packages, without a number of threads."""
    # If inherited, it would keep a Python of another environment from setting its library path.
    apart = {"_ROS_WHEELS_BOOTSTRAP_COMPLETE", *VARIABLES}
    environment = {name: value for name, value in os.environ.items() if name not in apart}
    root = str(Path(__file__).resolve().parents[2])
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, [root, environment.get("PYTHONPATH")]))
    return {**environment, **given}


@contextmanager
def process(*arguments: str, **given: str) -> Iterator[int]:
    """Run another Python with this repository's packages; yields its process id. given: environment variables."""
    running = subprocess.Popen([sys.executable, *arguments], env=environment_of(**given))
    try:
        yield running.pid
    finally:
        running.terminate()
        running.wait(10.0)


def single_requests(model: PushModel, count: int) -> list[PredictPush.Request]:
    """Requests for `count` of the model's training pushes, drawn at random."""
    rows = model.training.take(np.random.default_rng(0).integers(0, len(model.training), count))
    needed = [rows.covariates[name].tolist() for name in model.needs]
    return [
        PredictPush.Request(
            velocity=v, contact=c, angle=a, duration=d, covariate_names=list(model.needs), covariate_values=values
        )
        for (v, c, a), d, *values in zip(rows.inputs.tolist(), rows.duration.tolist(), *needed, strict=True)
    ]


def outside_requests(model: PushModel, count: int) -> list[PredictPush.Request]:
    """Requests for `count` pushes outside the model's domain."""
    inputs, duration = outside_pushes(model, count), model.usual_duration
    return [PredictPush.Request(velocity=v, contact=c, angle=a, duration=duration) for v, c, a in inputs.tolist()]


def load() -> str:
    """The machine's load averages, to print next to times."""
    return "{:.1f} {:.1f} {:.1f}".format(*os.getloadavg())
