# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Many clients and many hours: the benchmarks in their short form, and constant memory."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_windows import made_up_windows, predict
from rclpy.context import Context
from rclpy.node import Node
from ros_harness import REPOSITORY, free_domain, node_environment, ros_context, wait_until
from synthetic import square_rig
from validator_bench import HEXAGON

from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.nodes.validator.prediction_client import PredictionClient
from push_predictor.online.files import row_file
from push_predictor.online.files.row_file import RowFile
from push_predictor.online.live_validation import LiveValidation
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.windows.push_window import windows_to_table
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


def test_answers_are_taken_while_the_executor_is_busy_with_samples():
    """The executor delivers one answer a turn; here it gets no turn at all."""
    domain = free_domain()
    with ros_context(domain) as node:
        node.create_service(PredictPush, "predict_push", lambda request, response: response)
        context = Context()
        context.init(args=[], domain_id=domain)
        busy = Node("busy", context=context)
        client = PredictionClient(busy, timeout=120.0)
        assert wait_until(lambda: client.server_available and node.count_clients("predict_push") > 0)
        answers: list[PredictPush.Response] = []
        for _ in range(30):
            client.ask(PredictPush.Request(), answers.append)

        def all_answered() -> bool:
            client.work()
            return len(answers) == 30

        assert wait_until(all_answered, 60.0), f"{len(answers)} answers"
        assert (client.open, client.timeouts, client.problems) == (0, 0, [])
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


def test_a_window_and_its_answer_take_forty_bytes_of_memory():
    """A day of pushing without a break, 432 000 windows, then takes less than 18 MB."""
    windows = made_up_windows(1500)
    model = train_model(windows_to_table(windows[:40]), square_rig(), "analytical", name="analytical")
    prediction = predict(model, windows[0])
    live = LiveValidation({"analytical": model})
    live.record(0, live.add(windows[0]), prediction)
    tracemalloc.start()
    for window in windows[1:]:
        live.record(0, live.add(window), prediction)
    taken = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert taken / len(windows) < 40.0
    assert len(live.windows) == 1500 and live.windows[1499].push_id == windows[1499].push_id
    assert np.array_equal(live.windows[1234].displacement, windows[1234].displacement)


def test_a_row_file_returns_the_rows_that_were_appended():
    rows, expected = RowFile(), [bytes([k % 256]) * (k % 7) for k in range(500)]
    for row in expected:
        rows.append(row)
    assert list(rows) == expected and rows[-1] == expected[-1] and rows[3:9] == expected[3:9]
    with pytest.raises(IndexError):
        rows[500]


def test_rows_stay_in_memory_when_the_disk_is_full(monkeypatch: pytest.MonkeyPatch):
    real: Any = os.pwrite

    def full(descriptor: int, data: bytes, place: int) -> int:
        if 10 <= place < 20:
            raise OSError(28, "No space left on device")
        return real(descriptor, data[:1] if place >= 30 else data, place)

    monkeypatch.setattr(row_file.os, "pwrite", full)
    rows, expected = RowFile(), [f"{k:05d}".encode() for k in range(10)]
    for row in expected:
        rows.append(row)
    assert list(rows) == expected


def test_a_row_file_has_no_name_and_is_closed_with_its_owner(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(row_file.tempfile, "tempdir", str(tmp_path))
    before = len(os.listdir("/proc/self/fd"))
    rows = RowFile()
    rows.append(b"row")
    assert not list(tmp_path.iterdir()) and len(os.listdir("/proc/self/fd")) == before + 1
    del rows
    assert len(os.listdir("/proc/self/fd")) == before
