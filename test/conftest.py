# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What several test files need: a small recording made up here, and the way to the measured data."""

from __future__ import annotations

import gc
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Collection, Generator, Iterator, Mapping
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from coarse import coarse_pictures
from hypothesis import settings
from threadpoolctl import threadpool_limits

from push_predictor.geometry.shapes import shape_outline
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording, ScalarStream, WrenchStream

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of node processes: two threads cost several times the CPU time
# The tests start some hundred processes. Without its bytecode on disk each would compile the package again: 0.3 s.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
threadpool_limits(limits=1, user_api="blas")  # of this process, which has loaded numpy already
# A busy machine is no failure. In CI the examples are the same each time; at a desk they are drawn anew.
settings.register_profile("unhurried", deadline=None, derandomize="CI" in os.environ)
settings.register_profile("short", settings.get_profile("unhurried"), max_examples=15)
settings.load_profile("unhurried")
MEASURED_DATA_VARIABLE = "PUSH_PREDICTOR_MEASURED_DATA"
NEEDS_ROS = re.compile(
    r"^\s*(?:from|import) (?:rclpy|rcl_interfaces|ros_harness|msg_adapters|\w+_msgs\b)", re.MULTILINE
)
LONGEST = {  # files that take six seconds of processor time or more, or that wait as long: a third of the workers' time
    "test_adaptation", "test_alarm", "test_blocks", "test_checks", "test_cli", "test_extended_model", "test_gym",
    "test_measured_end_to_end", "test_mpc",
    "test_outline_causes", "test_paper_report", "test_prior_model", "test_tabulated_model",
    "test_trace_verdicts",
    "test_faults_bags", "test_faults_kill", "test_faults_load", "test_faults_network_security", "test_node_lab_topics",
    "test_node_predict_server", "test_node_push_alarm", "test_node_push_recorder", "test_node_push_replay",
    "test_node_push_validator", "test_node_trace_residual",
}  # fmt: skip


DRAWN_AS_FOR_READERS = {"test_canvas", "test_paper_divergence", "test_paper_report"}


def pytest_configure(config: pytest.Config) -> None:
    """One folder of kept tables for the whole run, empty at its start: the servers of a run share their tables.

    Without the long tests, 15 examples of 100: each run at a desk draws others.
    """
    if "not long" in config.option.markexpr:
        settings.load_profile("short")
    if not hasattr(config, "workerinput"):  # workers inherit the variable
        os.environ["PUSH_PREDICTOR_CACHE"] = tempfile.mkdtemp(prefix="push_predictor-tables-")


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the folder."""
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ["PUSH_PREDICTOR_CACHE"], ignore_errors=True)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Spare the garbage collector the modules and tests collected: all of them stay until the end."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark tests: `ros` if the module imports ROS, `measured` if they read measured data, `slow` if they are long.

    Order the files.
    """
    needs_ros = {path: bool(NEEDS_ROS.search(path.read_text())) for path in {item.path for item in items}}
    for item in items:
        if needs_ros[item.path]:
            item.add_marker(pytest.mark.ros)
        if "measured_data" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.measured)
        if item.get_closest_marker("long"):
            item.add_marker(pytest.mark.slow)
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    place = _places(needs_ros, slow)
    items.sort(key=lambda item: place[item.path])


def _places(needs_ros: Mapping[Path, bool], slow: Collection[Path]) -> dict[Path, tuple[bool, float, Path]]:
    """Places of the files in the order of the tests.

    Long and slow files come first, so that at the end no worker waits for one. Files that wait for nodes are spread
    evenly among those that compute, so that all cores are busy.
    """
    groups: dict[tuple[bool, bool], list[Path]] = {}
    for path in sorted(needs_ros, key=lambda path: (path.stem not in LONGEST, path)):
        groups.setdefault((path in slow or path.stem in LONGEST, needs_ros[path]), []).append(path)
    return {
        path: (not early, (index + 0.5) / len(group), path)
        for (early, _), group in groups.items()
        for index, path in enumerate(group)
    }


@pytest.fixture(scope="module", autouse=True)
def coarse_figures(request: pytest.FixtureRequest) -> Iterator[None]:
    """Figures in a quarter of the time, but for the files that look at them."""
    with nullcontext() if request.module.__name__ in DRAWN_AS_FOR_READERS else coarse_pictures():
        yield


@pytest.fixture(scope="session")
def measured_data() -> Path:
    """The folder with the data measured by others; it is no part of this repository."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get(MEASURED_DATA_VARIABLE, beside))
    if not (folder / "mit_square").is_dir():
        pytest.skip(f"no measured data at {folder}: set {MEASURED_DATA_VARIABLE} to their folder to run this test")
    return folder


@pytest.fixture
def rig() -> Rig:
    """A 0.09 m steel square on plywood."""
    return Rig("rect1", shape_outline("rect1"), 0.00475, "plywood", 0.837)


@pytest.fixture
def recording(rig: Rig) -> Recording:
    """One second at 250 Hz: a pusher drives at 20 mm/s, a slider follows it; force and temperature are recorded."""
    n = 250
    stamp = 1_700_000_000_000_000_000 + 4_000_000 * np.arange(n, dtype=np.int64)
    travel = 0.02 * 0.004 * np.arange(n)
    still = np.zeros(n)
    slider = PoseStream(stamp, travel, still + 0.001, still + 0.013, 0.1 * travel)
    pusher = PoseStream(stamp + 1_000_000, travel - 0.05, still, still + 0.02, still)
    wrench = WrenchStream(stamp + 2_000_000, still - 1.5, 0.1 * np.sin(travel), still)
    temperature = ScalarStream(stamp[::25] + 3_000_000, 21.0 + np.arange(10) * 0.1)
    return Recording("made_up", rig, slider, pusher, wrench, {"/table/temperature": temperature})
