# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Importers on data measured by others: the frames fit the contact, the known quirks are told, nothing is lost."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from push_predictor.geometry.frames import rotate, to_body
from push_predictor.recordings.importers import ImportReport, import_source
from push_predictor.recordings.importers.cleaning import in_order, without_repeats
from push_predictor.recordings.importers.mcube import ALUMINIUM, PUSHER_RADIUS, STEEL, TIP_LATE, read_numbers
from push_predictor.recordings.importers.staging import Notes
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.rig import load_rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table_file import read_table
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.types import Array

BAGS = ("robot_push_many", "robot_push_many_6_sd", "robot_push_steelblock")
RUNS = [f"{block}_block_metal_{run}" for block in ("Al", "St") for run in (1, 2, 3, 4)]


Imported = tuple[ImportReport, dict[str, Recording]]


@pytest.fixture(scope="module")
def mcube(measured_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Imported:
    out = tmp_path_factory.mktemp("mcube")
    report = import_source("mcube", [measured_data / "mcube_preliminary"], out)
    return report, {path.name: read_recording(path) for path in report.written}


class Contact:
    """The tip against the slider while the force tells contact and the tip moves; (n,) each."""

    def __init__(self, recording: Recording, least_force: float = 0.5, far: float = 0.004) -> None:
        assert recording.rig is not None and recording.wrench is not None
        tip, slider, wrench = recording.pusher, recording.slider, recording.wrench
        time = tip.stamp * 1e-9
        poses = [np.interp(tip.stamp, slider.stamp, z) for z in (slider.x, slider.y, np.unwrap(slider.heading))]
        self.pose = np.column_stack(poses)
        self.tip = np.column_stack([tip.x, tip.y])
        self.force = np.column_stack([np.interp(tip.stamp, wrench.stamp, z) for z in (wrench.fx, wrench.fy)])
        touch = recording.rig.outline.project(to_body(self.tip, self.pose))
        self.gap = touch.distance - recording.rig.pusher_radius
        self.normal = rotate(touch.normal, self.pose[:, 2])
        speed = np.hypot(*np.gradient(self.tip, time, axis=0).T)
        within = (tip.stamp > slider.stamp[0]) & (tip.stamp < slider.stamp[-1])
        pressed = np.hypot(*self.force.T) > least_force
        keep = within & pressed & (np.abs(self.gap) < far) & (speed > 0.005)
        for name in ("pose", "tip", "force", "gap", "normal"):
            setattr(self, name, getattr(self, name)[keep])


# --- mcube --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("run", RUNS)
def test_in_contact_the_tip_is_on_the_outline_and_the_force_points_out_of_the_slider(mcube: Imported, run: str) -> None:
    contact = Contact(mcube[1][run])
    assert len(contact.gap) > 60
    assert abs(np.median(contact.gap)) < 0.3e-3
    assert np.std(contact.gap) < 1.0e-3
    along = np.sum(contact.force * contact.normal, axis=1) / np.linalg.norm(contact.force, axis=1)
    assert np.median(along) > np.cos(np.radians(15.0)), "within friction of the contact normal"


def test_the_clock_offset_is_that_of_the_delay_test_without_repeated_rows(measured_data: Path) -> None:
    folder, notes = measured_data / "mcube_preliminary" / "time_delay", Notes()
    vicon = in_order(read_numbers(folder / "Output_vicon_tcpvicon.txt", 2, notes), "vicon", notes)
    tip = without_repeats(
        in_order(read_numbers(folder / "Output_tip_tcpvicon.txt", 2, notes), "tip", notes), "tip", notes
    )

    def scatter(late: float) -> float:
        """Standard deviation (m) of what a straight line from Vicon's x to the tip's leaves."""
        when = tip.stamp - round(late * 1e9)
        inside = (when > vicon.stamp[0]) & (when < vicon.stamp[-1])
        x = np.interp(when[inside], vicon.stamp, vicon.values[:, 0] / 1000.0)
        line = np.polynomial.Polynomial.fit(x, tip.values[inside, 0], 1)
        return float(np.std(tip.values[inside, 0] - line(x)))

    delays = np.arange(0.0, 0.040, 0.0005)
    best = delays[np.argmin([scatter(delay) for delay in delays])]
    assert best == pytest.approx(TIP_LATE * 1e-9, abs=0.0006)
    assert scatter(best) < 0.2e-3 < scatter(0.020)


@pytest.mark.parametrize(("block", "prefix"), [(ALUMINIUM, "Al"), (STEEL, "St")])
def test_side_and_frames_are_what_a_fit_to_the_contact_gives(mcube: Imported, block: object, prefix: str) -> None:
    """Fitted: half side and shifts of the two frames; for steel the recorded frames were kept, so the side alone."""
    contacts = [Contact(recording) for run, recording in mcube[1].items() if run.startswith(prefix)]
    half = STEEL.half_side if block is STEEL else ALUMINIUM.half_side

    def residual(x: Array) -> Array:
        shift = np.pad(x[1:], (0, 5 - len(x)))
        bodies = [to_body(c.tip + shift[:2], c.pose) - shift[2:] for c in contacts]
        return np.concatenate([np.abs(_facing(body, half)) - half - PUSHER_RADIUS - x[0] for body in bodies])

    unknown = 1 if block is STEEL else 5
    fit = least_squares(residual, np.zeros(unknown), loss="soft_l1", f_scale=5e-4, x_scale=1e-3)
    assert np.max(np.abs(fit.x)) < (0.2e-3 if block is STEEL else 0.5e-3)


def _facing(body: Array, half: float) -> Array:
    """The coordinate (n,) of tips (n, 2) that is across the side they touch, without those near a corner."""
    across = int(np.argmax(np.mean(np.abs(body), axis=0)))
    return body[np.abs(body[:, 1 - across]) < half - 0.008, across]


def test_the_report_states_what_was_done(mcube: Imported) -> None:
    report, recordings = mcube
    assert sorted(recordings) == RUNS and report.pushes == 8
    assert sum("the tip stream stops" in line for line in report.dropped) == 4
    assert sum("repeat the tip's position" in line for line in report.repaired) == 8
    for words in ("15 ms late", "not measured", "fitted to the contact", "surface unknown"):
        assert any(words in line for line in report.assumed), words


# --- ROS 1 bags ---------------------------------------------------------------------------------------------------


def test_the_bag_of_aluminium_run_1_equals_its_text_files(measured_data: Path, mcube: Imported, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    alone = tmp_path / "elsewhere.bag"  # the folder's name no longer tells the block, the day does
    shutil.copyfile(measured_data / "mcube_preliminary" / "Al_block" / "Test_metal_1.bag", alone)
    bag = read_recording(import_source("rosbag1", [alone], tmp_path / "out").written[0])
    text = mcube[1]["Al_block_metal_1"]
    inside = (bag.slider.stamp >= text.slider.stamp[0]) & (bag.slider.stamp <= text.slider.stamp[-1])
    for name, tolerance in (("x", 1e-6), ("y", 1e-6), ("heading", 2e-3)):
        expected = np.interp(bag.slider.stamp[inside], text.slider.stamp, np.unwrap(getattr(text.slider, name)))
        np.testing.assert_allclose(np.unwrap(getattr(bag.slider, name))[inside], expected, atol=tolerance)
    np.testing.assert_allclose(bag.pusher.x[:100], text.pusher.x[:100], atol=1e-6)
    assert bag.wrench is not None and np.any(bag.wrench.torque != 0.0)


@pytest.fixture(scope="module")
def bags(measured_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Imported:
    """Three bags of mlab, by name: reading all six takes three seconds."""
    pytest.importorskip("rosbags")
    sources = [measured_data / "mlab" / "bags" / f"{name}.bag" for name in BAGS]
    report = import_source("rosbag1", sources, tmp_path_factory.mktemp("bags"))
    return report, {path.name: read_recording(path) for path in report.written}


def test_mlab_bags_are_imported_with_bag_time_and_without_a_rig(bags: Imported) -> None:
    report, recordings = bags
    assert report.recordings == len(recordings) == 3
    assert sum("header stamps lead the bag's clock by 36" in line for line in report.repaired) == 3
    assert any("2812 of 2896 frames" in line for line in report.dropped)
    for recording in recordings.values():
        assert recording.rig is None
        span = recording.pusher.stamp[-1] - recording.pusher.stamp[0]
        assert recording.wrench is not None and abs(recording.wrench.stamp[0] - recording.pusher.stamp[0]) < 1e9
        assert span > 30e9


# --- mit ----------------------------------------------------------------------------------------------------------


def test_the_mit_push_touches_its_outline_and_the_force_points_out_of_the_slider(
    measured_data: Path, tmp_path: Path
) -> None:
    report = import_source("mit", [measured_data / "mit_raw"], tmp_path)
    recording = read_recording(report.written[0])
    assert recording.rig is not None and recording.rig.shape == "hex" and recording.rig.surface == "plywood"
    assert (len(recording.pusher), len(recording.slider)) == (205, 207)
    contact = Contact(recording, least_force=1.0)
    assert abs(np.median(contact.gap)) < 0.5e-3 and np.std(contact.gap) < 0.5e-3
    assert np.mean(np.sum(contact.force * contact.normal, axis=1) > 0.0) > 0.85
    assert find_windows(recording, recording.rig)


# --- mit-square ---------------------------------------------------------------------------------------------------


def test_in_the_documented_frame_the_contact_stays_on_the_side(measured_data: Path, tmp_path: Path) -> None:
    """After 4 mm of travel the pusher still touches the turned side; with dy the other way it does not."""
    import_source("mit-square", [measured_data / "mit_square" / "pushes_3500.npz"], tmp_path)
    table = read_table(tmp_path / "pushes_3500.csv")
    outline = load_rig(tmp_path / "pushes_3500.rig.yaml").outline
    contact, angle = table.inputs[:, 1], table.inputs[:, 2]
    start = outline.point(contact) - 0.00475 * outline.inward_normal(contact)
    tip = start + 0.004 * np.column_stack([np.cos(angle), np.sin(angle)])

    def median_gap(dy_sign: float) -> float:
        moved = rotate(table.outcomes[:, :2] * [1.0, dy_sign], angle)
        body = to_body(tip, np.column_stack([moved, table.outcomes[:, 2]]))
        return float(np.median(np.abs(outline.project(body).distance - 0.00475)))

    assert median_gap(1.0) < 0.05e-3 < 0.3e-3 < median_gap(-1.0)


# --- mlab ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mlab(measured_data: Path, tmp_path_factory: pytest.TempPathFactory) -> ImportReport:
    return import_source("mlab", [measured_data / "mlab" / "sensor_log"], tmp_path_factory.mktemp("mlab"))


def test_the_350_point_pushes_equal_the_table_derived_by_others(measured_data: Path, mlab: ImportReport) -> None:
    with (measured_data / "mlab" / "point_pushes.csv").open() as lines:
        derived = list(csv.DictReader(lines))
    assert mlab.pushes == len(derived) == 350
    for path in (path for path in mlab.written if path.suffix == ".csv"):
        table, outline = read_table(path), load_rig(path.with_suffix(".rig.yaml")).outline
        rows = [row for row in derived if row["file"].replace("/", "_").removesuffix(".txt") == path.stem]
        assert len(table) == len(rows) == 50
        edge, fraction = outline.edge(table.inputs[:, 1])
        length = np.array([150.0, 150.0 * np.sqrt(2.0), 150.0])[edge]
        for name, column, rounding in (
            ("edge", edge, 0.0),
            ("s_mm", fraction * length, 0.51e-3),
            ("beta_ccw_rad", table.inputs[:, 2], 0.51e-6),
            ("dx_push_mm", table.outcomes[:, 0] * 1e3, 0.51e-4),
            ("dy_push_mm", table.outcomes[:, 1] * 1e3, 0.51e-4),
            ("dtheta_rad", table.outcomes[:, 2], 0.51e-6),
            ("heading_rad", table.covariates["push_heading"], 0.51e-6),
            ("fn_mean_N", table.covariates["normal_force"], 0.01),
            ("ft_left_mean_N", table.covariates["tangential_force"], 0.01),
        ):
            expected = np.array([float(row[name]) for row in rows])
            np.testing.assert_allclose(column, expected, rtol=0.0, atol=rounding, err_msg=f"{path.name} {name}")
        travel = np.array([float(row["tip_travel_mm"]) - float(row["gap_mm"]) for row in rows])
        np.testing.assert_allclose(table.inputs[:, 0] * table.duration * 1e3, travel, atol=0.05)
        assert np.all(np.abs(table.inputs[:, 0] - 0.0025) < 5e-5)


def test_irregularities_of_the_measured_mlab_logs_are_reported(mlab: ImportReport) -> None:
    assert any("after push 29 the clock goes back by 2897 s" in line for line in mlab.repaired)
    assert sum("moved by hand" in line for line in mlab.assumed) >= 5
    shares = {path.name: load_rig(path).support_points for path in mlab.written if path.suffix == ".yaml"}
    assert sum(support is None for support in shares.values()) == 2, "two patches"


@pytest.mark.parametrize(
    ("name", "pushes", "words"),
    [
        ("exp0", 5, ["the number of pushes is missing"]),
        ("exp2_30", 15, ["states 30 pushes, contains 15", "15 pushes without forces"]),
        ("exp7_20", 20, []),
        ("exp8_35_mixed", 35, ["after push 14 the clock goes back"]),
        ("exp9_15", 11, ["states 15 pushes, contains 11"]),
    ],
)
def test_irregular_logs_are_imported_as_far_as_possible_and_reported(
    measured_data: Path, tmp_path: Path, name: str, pushes: int, words: list[str]
) -> None:
    report = import_source("mlab", [measured_data / "mlab" / "quirky_logs" / f"{name}.txt"], tmp_path)
    told = "\n".join([*report.dropped, *report.repaired])
    assert report.pushes == pushes
    assert all(word in told for word in words)
