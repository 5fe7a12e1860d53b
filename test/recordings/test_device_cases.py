# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings as devices in public bug reports make them: what `check` finds, and which windows remain.

../shared/labs/cases.py alters bags/square_abs_train in 94 ways. A case has exactly the findings that are named here,
without notes. Its windows are those of the sound recording; the table says where there are fewer or more.
"""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from push_predictor.cli import build_parser
from push_predictor.commands.common.options import Reading, with_signed_axes
from push_predictor.errors import PushPredictorError
from push_predictor.recordings.checks.check import checked_data
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.windows.finder import find_windows

pytest.importorskip("rosbags")
pytest.importorskip("zstandard")
REPOSITORY = Path(__file__).resolve().parents[2]
LABS = REPOSITORY.parent / "shared" / "labs"
SOURCE = REPOSITORY / "bags" / "square_abs_train"
NEAR = 0.02  # of the number of windows
SAME_TIME = 0.06  # s between the beginnings of two windows of one push
SAME_MOTION = np.array([0.0003, 0.0003, 0.01])  # m, m, rad: median difference of the outcomes of such windows
PER_NOISE = np.array([1.0, 1.0, np.radians(500.0)])  # of the noise of two poses, whose heading has 0.5 degrees per mm
DAY = 86400.0  # s


@dataclass(frozen=True)
class Case:
    """A recording, its findings without notes, and the options with which it is read.

    windows: their number as a share of those of the sound recording; None if the recording is refused. noise: of the
    tracker in this recording, m; an outcome has that of two poses.
    """

    name: str
    findings: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    windows: float | None = 1.0
    noise: float = 0.0

    def __str__(self) -> str:
        return " ".join([self.name, *self.options])


CASES = (
    Case("c00_plain"),
    Case("c01_vicon_zero"),
    Case("c01_vicon_zero_20", windows=0.93),
    Case("c01_vicon_zero_identity", windows=0.87),
    Case("c02_hold", ("held_poses_slider",)),
    Case("c02_hold_20", ("held_poses_slider",), windows=0.93),
    Case("c03_flip180", ("heading_flips",)),
    Case("c03_flip90", ("heading_flips",)),
    Case("c03_flip_dense", ("heading_flips",)),
    Case("c04_stamp0_all", ("stamps_unset",), windows=None),
    Case("c04_stamp0_all", options=("--stamp", "log")),
    Case("c04_stamp0_slider", ("stamps_unset",), windows=None),
    Case("c04_stamp0_slider", options=("--stamp", "log")),
    Case("c05_burst_slider", ("stamp_bursts",)),
    Case("c05_burst_slider", ("stamp_bursts",), options=("--stamp", "log")),
    Case("c05_plain50", windows=1.07),
    Case("c06a_base_axes_named_tool0"),
    Case("c06a_base_axes_named_tool0", options=("--wrench-frame", "world")),
    Case("c06b_frame_empty"),
    Case("c06c_bias", ("wrench_zero",)),
    Case("c06c_bias", options=("--wrench-bias", "free_motion")),
    Case("c06c_bias_hysteresis", ("wrench_zero",)),
    Case("c06c_bias_hysteresis", options=("--wrench-bias", "free_motion")),
    Case("c06d_tool_137_tf", ("wrench_frame",)),
    Case("c06d_tool_137_tf", options=("--wrench-frame", "tool0")),
    Case("c06d_tool_137_tf", ("wrench_frame",), options=("--wrench-frame", "tip")),
    Case("c06e_turned_43", ("wrench_frame",)),
    Case("c06f_turned_90", ("wrench_frame",)),
    Case("c07_db3_zstd_file"),
    Case("c07_empty_metadata"),
    Case("c07_file_zstd"),
    Case("c07_file_zstd_nometa"),
    Case("c07_first_split_missing", ("data_lost",), windows=0.68),
    Case("c07_kilted"),
    Case("c07_no_metadata"),
    Case("c07_split_missing", ("data_lost",), windows=0.67),
    Case("c07_sqlite"),
    Case("c07_sqlite_message"),
    Case("c07_storage_empty"),
    Case("c08_empty_schema"),
    Case("c08_empty_topic"),
    Case("c08_idl_slider"),
    Case("c08_no_schema_beside"),
    Case("c08_no_schema_slider"),
    Case("c08_no_schema_wrench"),
    Case("c08_unchunked"),
    Case("c09_mm_both", ("units_length_pusher", "units_length_slider"), windows=None),
    Case("c09_mm_offset", ("units_length_pusher", "units_length_slider"), windows=None),
    Case("c09_mm_slider", ("units_length_slider",), windows=None),
    Case("c09_offset", ("no_pushes", "outline_shifted"), windows=0.00),
    Case("c09_yup_body_both", ("world_up",), windows=None),
    Case("c09_yup_body_both", options=("--up", "y")),
    Case("c09_yup_both", ("world_up",), windows=None),
    Case("c09_yup_both", options=("--up", "y")),
    Case("c09_yup_slider", ("world_up",), windows=None),
    Case("c09_yup_slider", options=("--up", "slider=y")),
    Case("c10_pi"),
    Case("c11_both10", ("rate_pusher", "rate_slider"), windows=None),
    Case("c11_pusher10", ("rate_pusher",), windows=None),
    Case("c11_pusher125"),
    Case("c11_pusher15", ("rate_pusher",)),
    Case("c11_slider30"),
    Case("c11_slider30_noise", ("noise_slider",), windows=0.89, noise=1e-3),
    Case("c12_late35", ("clocks_apart",), windows=0.97),
    Case("c12_late9"),
    Case("c12_sim_wall", ("clocks_never_meet",), windows=None),
    Case("c12_sim_wall", options=("--stamp", "log")),
    Case("c13_frames_notf", ("frames_apart", "no_pushes"), windows=0.00),
    Case("c13_frames_split", ("frames_apart", "no_pushes"), windows=0.00),
    Case("c13_frames_split", options=("--world-frame", "vicon/world", "--wrench-frame", "base_link")),
    Case("c13_frames_static0", ("frames_apart", "no_pushes"), windows=0.00),
    Case("c13_frames_static0", options=("--world-frame", "vicon/world", "--wrench-frame", "base_link")),
    Case("c13_frames_tf", ("frames_apart", "no_pushes"), windows=0.00),
    Case("c13_frames_tf", options=("--world-frame", "vicon/world", "--wrench-frame", "base_link")),
    Case("c14_franka_matrix", options=("--pusher-topic", "/franka_state_controller/franka_states.o_t_ee")),
    Case("c14_pose_array", options=("--slider-topic", "/poses.poses[1]", "--pusher-topic", "/poses.poses[2]")),
    Case("c14_rigid_bodies", options=("--slider-topic", "/rigid_bodies.rigidbodies[1].pose")),
    Case("c14_rigid_bodies", options=("--slider-topic", "/rigid_bodies.rigidbodies[block].pose")),
    Case("c15_clock_drift", ("clock_drift",)),
    Case("c15_clock_step", ("clock_step",), windows=None),
    Case("c15_commanded_tip", ("clocks_apart",), windows=1.05),
    Case("c15_csv"),
    Case("c15_csv_3_decimals", ("resolution_pusher", "resolution_slider"), windows=None),
    Case("c15_csv_deg", ("units_heading",), windows=None),
    Case("c15_csv_ms", ("units_time_pusher", "units_time_slider"), windows=None),
    Case("c15_filtered", ("clocks_apart",)),
    Case("c15_flange", ("tip_height",), windows=None),
    Case("c15_hand_resets"),
    Case("c15_kgf", ("wrench_units",)),
    Case("c15_lift15"),
    Case("c15_loop", ("loop_recorded",)),
    Case("c15_marker_height"),
    Case("c15_namespaced_tf", options=("--pusher-topic", "/robot1/tf:tool0")),
    Case("c15_nan_lost", windows=0.93),
    Case("c15_ned", ("world_up",), windows=None),
    Case("c15_ned", options=("--up", "-z")),
    Case("c15_nsec_bug", ("stamps_unset",), windows=None),
    Case("c15_nsec_bug", options=("--stamp", "log")),
    Case("c15_planar_tip"),
    Case("c15_planar_tip_no_wrench"),
    Case("c15_quantised", ("resolution_pusher", "resolution_slider"), windows=None),
    Case("c15_republished_twice", ("sent_twice",)),
    Case("c15_scale", ("frames_apart",)),
    Case("c15_tf_stale", options=("--slider-topic", "/tf:block", "--pusher-topic", "/tf:tool0")),
    Case("c15_two_publishers", ("two_bodies_slider",)),
    Case("c15_wrench_early120", ("wrench_lag",)),
    Case("c15_wrench_lag", ("wrench_lag",)),
    Case("c15_wrench_lag20", ("wrench_lag",)),
    Case("c15_wrench_lag50", ("wrench_lag",)),
    Case("c15_wrench_stops", ("wrench_missing",)),
    Case("c15_zoh30", ("repeated_poses_slider",)),
)
INCOMPLETE = {"c15_two_bodies_reversed"}  # calls a case that the file lacks
# What is not there, or not in a field that was named, is refused with the options that help.
UNREAD = {
    "c13_frames_notf": (("--world-frame", "vicon/world"), "no /tf from there to 'vicon/world'"),
    "c14_franka_matrix": ((), r"give --pusher-topic"),
    "c14_pose_array": ((), "give --slider-topic and --pusher-topic"),
    "c14_rigid_bodies": ((), "give --slider-topic"),
    "c15_namespaced_tf": ((), "give --pusher-topic"),
    "c15_tf_stale": ((), "give --slider-topic and --pusher-topic"),
}


@cache
def labs() -> ModuleType:
    """The module that makes the recordings."""
    if not (LABS / "cases.py").is_file():
        pytest.skip(f"no device cases at {LABS}: they are no part of this repository")
    spec = importlib.util.spec_from_file_location("device_cases", LABS / "cases.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def made(name: str, folder: Path) -> Path:
    """A recording of a case."""
    module = labs()
    module.CASES[name](module.read(SOURCE), np.random.default_rng(0), folder / name)
    return folder / name


def read_with(path: Path, options: tuple[str, ...]) -> Reading:
    words = ["check", str(path), "--rig", str(LABS / "rig.yaml"), *options]
    return Reading(build_parser(["check"]).parse_args(with_signed_axes(words)))


@cache
def sound() -> tuple[float, np.ndarray, np.ndarray]:
    """Time of the first sample in s, beginnings (n,) in s and outcomes (n, 3) of windows of the unaltered recording."""
    recording = read_recording(SOURCE)
    assert recording.rig is not None
    windows = find_windows(recording, recording.rig)
    starts, outcomes = np.array([1e-9 * w.start for w in windows]), np.array([w.displacement for w in windows])
    return 1e-9 * float(recording.slider.stamp[0]), starts, outcomes


def test_every_case_is_listed() -> None:
    assert {case.name for case in CASES} == set(labs().CASES) - INCOMPLETE


@pytest.mark.long
@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_device_case_has_its_findings_and_windows(case: Case, tmp_path: Path) -> None:
    path = made(case.name, tmp_path)
    reading = read_with(path, case.options)
    checked = checked_data(path, reading.rig, reading.topics)
    findings = {finding.name for finding in checked.findings if finding.severity != "note"}
    assert findings == set(case.findings)
    assert checked.refused == (case.windows is None)
    if checked.table is None or case.windows is None:
        return
    first, begin, outcome = sound()
    assert abs(len(checked.table) - case.windows * len(begin)) <= NEAR * len(begin)
    if case.windows:
        assert checked.recording is not None and checked.rig is not None
        windows = find_windows(checked.recording, checked.rig)
        starts = np.array([1e-9 * each.start for each in windows])
        starts += first if starts[0] < DAY else 0.0  # a time that is counted from the first sample
        nearest = np.clip(np.searchsorted(begin, starts), 1, len(begin) - 1)
        nearest -= starts - begin[nearest - 1] < begin[nearest] - starts
        same = np.abs(starts - begin[nearest]) < SAME_TIME
        assert np.mean(same) > 0.9
        moved = np.array([each.displacement for each in windows])[same] - outcome[nearest[same]]
        assert np.all(np.median(np.abs(moved), axis=0) < SAME_MOTION + case.noise * PER_NOISE)


@pytest.mark.long
@pytest.mark.parametrize("name", UNREAD)
def test_a_device_case_that_is_read_wrongly_is_refused_with_the_option(name: str, tmp_path: Path) -> None:
    options, words = UNREAD[name]
    path = made(name, tmp_path)
    reading = read_with(path, options)
    with pytest.raises(PushPredictorError, match=words):
        checked_data(path, reading.rig, reading.topics)
