# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Many clients and many hours: the benchmarks in their short form, and constant memory."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from ros_harness import REPOSITORY, free_domain, node_environment, ros_context, wait_until
from validator_bench import HEXAGON

from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.nodes.validator.server_client import PredictionClient
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor_interfaces.srv import PredictPush


def benchmark(name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run benchmarks/nodes/NAME.py in a domain of its own."""
    domain = free_domain()
    command = [sys.executable, "-m", f"benchmarks.nodes.{name}", "--domain", str(domain), *arguments]
    return subprocess.run(
        command, cwd=REPOSITORY, env=node_environment(domain), capture_output=True, text=True, timeout=400, check=False
    )


# --- many clients ----------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_all_clients_are_answered_in_spite_of_a_deaf_and_a_stopped_one():
    """The long form: 50 clients, 10 minutes."""
    done = benchmark("load", "--clients", "6", "--minutes", "0.05", "--every", "1")
    text = done.stdout + done.stderr
    assert done.returncode == 0, text
    for service in ("predict_push", "predict_push_batch"):
        line = next(line for line in text.splitlines() if line.startswith(f"{service} "))
        asked, answered = map(int, re.findall(r"asked (\d+), answered (\d+)", line)[0])
        assert asked == answered > 0 and "p99" in line and "lost without an error 0" in line
    served = int(re.findall(r"it answered (\d+)", text)[0])
    answered = sum(map(int, re.findall(r"answered (\d+): p50", text)))
    assert served > answered  # also requests of the deaf and the stopped client
    (grown,) = re.findall(r"threads ([+-]\d+), descriptors ([+-]\d+)", text)
    assert max(map(int, grown)) <= 0, text


def test_all_requests_of_a_burst_are_answered_in_turns_of_the_executor():
    domain = free_domain()
    with ros_context(domain) as node:
        node.create_service(PredictPush, "predict_push", lambda request, response: response)
        context = Context()
        context.init(args=[], domain_id=domain)
        busy = Node("busy", context=context)
        client, executor = PredictionClient(busy, timeout=120.0), SingleThreadedExecutor(context=context)
        executor.add_node(busy)
        assert wait_until(lambda: client.server_available and node.count_clients("predict_push") > 0)
        answers: list[PredictPush.Response] = []
        for _ in range(30):
            client.ask(PredictPush.Request(), answers.append)

        def all_answered() -> bool:
            client.work()
            executor.spin_once(timeout_sec=0.0)
            return len(answers) == 30

        assert wait_until(all_answered, 60.0), f"{len(answers)} answers"
        assert (client.open, client.timeouts, client.problems) == (0, 0, [])
        executor.shutdown()
        busy.destroy_node()
        context.try_shutdown()


# --- many hours ------------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_files_and_threads_of_the_nodes_stay_constant_over_recorded_hours(tmp_path: Path):
    """The long form: 24 recorded hours. A few seconds are too short for memory."""
    data = [HEXAGON]
    model = train_model(
        load_data(data), load_rig_for(data), "gp", name="gp", options=TrainingOptions(n_train=40, mean="zero")
    )
    save_model(model, tmp_path / "gp.pushmodel")
    done = benchmark(
        "endurance", "--minutes", "0.14", "--rate", "10", "--every", "0.1", "--warm-up", "0.1", "--most-growth", "60",
        "--recording", str(HEXAGON), "--model", str(tmp_path / "gp.pushmodel"),
    )  # fmt: skip
    text = done.stdout + done.stderr
    assert done.returncode == 0, text
    hours, rate = map(float, re.findall(r"([\d.]+) recorded hours in \d+ s: rate (\d+)", text)[0])
    assert hours > 0.0 and rate > 1.0 and "behind by" in text
    for node in ("predict_server", "push_validator", "push_replay", "push_validator, alarm"):
        (line,) = [line for line in text.splitlines() if line.startswith(f"{node} ") and "after warm-up" in line]
        threads, descriptors = map(int, re.findall(r"threads ([+-]\d+), descriptors ([+-]\d+)", line)[0])
        assert threads <= 0 and descriptors <= 2  # a check of the samples takes two while it runs
    assert max(map(int, re.findall(r"(\d+) descriptors\n", text))) < 60  # one for each window would exceed it
