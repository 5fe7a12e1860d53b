# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Importers write complete recordings in the documented frames, report every repair and reject invalid files."""

from __future__ import annotations

import gzip
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from push_predictor.errors import ImportSourceError, RecordingError
from push_predictor.geometry.frames import rotate, to_body, wrap_angle
from push_predictor.geometry.shapes import shape_outline
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.importers.cleaning import Samples, in_order, nanoseconds, repair_heading, without_repeats
from push_predictor.recordings.importers.mcube import headings
from push_predictor.recordings.importers.mlab import first_touch, load_shares, triangle
from push_predictor.recordings.importers.staging import Notes, sources_in
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.rig import Rig, load_rig
from push_predictor.recordings.table_file import read_table

START = 1_460_088_637.25


# --- mit ----------------------------------------------------------------------------------------------------------


def _mit_streams() -> dict[str, list[list[float]]]:
    """A tip that pushes a square along +x at 20 mm/s; 50 samples at 250 Hz."""
    t = START + 0.004 * np.arange(50)
    x = 0.02 * 0.004 * np.arange(50)
    still = np.zeros(50)
    return {
        "tip_pose": np.column_stack([t, x - 0.04975, still, still]).tolist(),
        "object_pose": np.column_stack([t + 0.001, x, still, still + 0.1]).tolist(),
        "ft_wrench": np.column_stack([t + 0.002, still - 1.0, still, still]).tolist(),
    }


def _mit_name(shape: str = "rect1", push: int = 0) -> str:
    return f"motion_surface=delrin_shape={shape}_a=0_v=20_i=0.000_s=0.{push}00_t=0.000"


def _write_mit(folder: Path, streams: dict[str, object], shape: str = "rect1", push: int = 0) -> Path:
    path = folder / f"{_mit_name(shape, push)}.json"
    path.write_text(json.dumps(streams))
    return path


def test_mit_file_becomes_a_readable_recording(tmp_path: Path) -> None:
    report = import_source("mit", [_write_mit(tmp_path, _mit_streams())], tmp_path / "out")
    recording = read_recording(report.written[0])
    assert report.recordings == report.pushes == 1
    assert report.written[0].name == _mit_name()
    assert recording.rig is not None
    assert (recording.rig.shape, recording.rig.surface, recording.rig.object_mass) == ("rect1", "delrin", 0.837)
    np.testing.assert_allclose(recording.pusher.x[0], -0.04975)
    np.testing.assert_allclose(recording.slider.heading, 0.1)
    assert recording.wrench is not None and np.all(recording.wrench.fx == -1.0)
    assert recording.pusher.stamp[0] == pytest.approx(START * 1e9, abs=500)


def test_hdf5_gives_the_same_recording_as_json(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    streams = _mit_streams()
    with h5py.File(tmp_path / f"{_mit_name(push=1)}.h5", "w") as content:
        for name, rows in streams.items():
            content[name] = np.array(rows)
    report = import_source(
        "mit", [tmp_path / f"{_mit_name(push=1)}.h5", _write_mit(tmp_path, streams)], tmp_path / "out"
    )
    one, two = (read_recording(path) for path in report.written)
    np.testing.assert_array_equal(one.slider.stamp, two.slider.stamp)
    np.testing.assert_array_equal(one.pusher.x, two.pusher.x)


def test_damaged_file_in_a_folder_or_zip_is_reported(tmp_path: Path) -> None:
    source = tmp_path / "set" / "deeper"
    source.mkdir(parents=True)
    _write_mit(source, _mit_streams(), push=0)
    (source / f"{_mit_name(push=1)}.json").write_text('{"tip_pose": [\n[1, 2')
    with zipfile.ZipFile(tmp_path / "set" / "more.zip", "w") as archive:
        archive.writestr(f"inside/{_mit_name(push=2)}.json", json.dumps(_mit_streams()))
    report = import_source("mit", [tmp_path / "set"], tmp_path / "out")
    assert {path.name for path in report.written} == {_mit_name(push=0), _mit_name(push=2)}
    assert len(report.dropped) == 1 and f"{_mit_name(push=1)}.json:2" in report.dropped[0]


def test_damaged_file_that_was_named_or_an_empty_archive_is_rejected(tmp_path: Path) -> None:
    (tmp_path / f"{_mit_name(push=1)}.json").write_text("{")
    sources = [_write_mit(tmp_path, _mit_streams(), push=0), tmp_path / f"{_mit_name(push=1)}.json"]
    with pytest.raises(ImportSourceError, match="1: not JSON"):
        import_source("mit", sources, tmp_path / "out")
    with zipfile.ZipFile(tmp_path / "empty.zip", "w") as archive:
        archive.writestr("README", "")
    with pytest.raises(ImportSourceError, match=r"empty\.zip: the archive contains no \.json"):
        import_source("mit", [tmp_path / "empty.zip"], tmp_path / "out")


def test_irregularities_of_the_mit_set_are_repaired_and_reported(tmp_path: Path) -> None:
    streams = _mit_streams()
    streams["tip_pose"].insert(10, list(streams["tip_pose"][9]))
    streams["ft_wrench"][20], streams["ft_wrench"][21] = streams["ft_wrench"][21], streams["ft_wrench"][20]
    for row in streams["object_pose"][30:]:
        row[3] += np.pi / 2 + 2 * np.pi
    streams["object_pose"][29][3] += 0.1  # on the way of the jump
    report = import_source("mit", [_write_mit(tmp_path, streams)], tmp_path / "out")
    recording = read_recording(report.written[0])
    assert (len(recording.pusher), len(recording.slider)) == (50, 49)
    assert np.ptp(np.unwrap(recording.slider.heading)) < 1e-9
    assert any("tip_pose: 1 rows that repeat" in line for line in report.dropped)
    assert any("ft_wrench: 1 rows out of order" in line for line in report.repaired)
    assert any("object_pose: 1 jumps" in line for line in report.repaired)


def test_forces_are_optional_and_poses_are_required(tmp_path: Path) -> None:
    streams: dict[str, object] = {**_mit_streams(), "ft_wrench": []}
    report = import_source("mit", [_write_mit(tmp_path, streams)], tmp_path / "out")
    assert read_recording(report.written[0]).wrench is None
    assert any("ft_wrench missing" in line for line in report.dropped)
    del streams["object_pose"]
    with pytest.raises(ImportSourceError, match="object_pose missing"):
        import_source("mit", [_write_mit(tmp_path, streams)], tmp_path / "out2")


def test_unknown_shape_is_rejected_unless_a_rig_is_given(tmp_path: Path) -> None:
    path = _write_mit(tmp_path, _mit_streams(), shape="butter")
    with pytest.raises(ImportSourceError, match=r"'butter'.*rect1.*--rig"):
        import_source("mit", [path], tmp_path / "out")
    rig = Rig("butter", shape_outline("ellip2"), 0.00475, "pu", 1.0)
    report = import_source("mit", [path], tmp_path / "out", rig)
    recorded = read_recording(report.written[0]).rig
    assert recorded is not None and recorded.shape == "butter"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("[1, 2]", "a list"),
        ('{"tip_pose": 3, "object_pose": []}', "tip_pose: a int"),
        ('{"tip_pose": [[1, 2, 3, 4], [1, 2, 3]], "object_pose": []}', r"tip_pose\[1\]"),
        ('{"tip_pose": [[1, 2, 3, "x"]], "object_pose": []}', r"tip_pose\[0\]"),
        ('{"tip_pose": [[1, 2, 3, 4]], "object_pose": [[1, 2, 3, 4]]}', "1 usable rows"),
        ('{"tip_pose": [[1,2,3,4],[2,2,3,4]], "object_pose": [[5,2,3,4],[6,2,3,4]]}', "do not overlap in time"),
        ("\n\n{", ":3: not JSON"),
    ],
)
def test_invalid_mit_file_is_rejected_with_the_position(tmp_path: Path, content: str, words: str) -> None:
    path = tmp_path / f"{_mit_name()}.json"
    path.write_text(content)
    with pytest.raises(ImportSourceError, match=words) as caught:
        import_source("mit", [path], tmp_path / "out")
    assert str(path) in str(caught.value)
    assert not (tmp_path / "out").exists(), "nothing half-written"


def test_damaged_archives_and_hdf5_files_are_rejected(tmp_path: Path) -> None:
    for name in ("broken.zip", f"{_mit_name()}.h5", f"{_mit_name()}.txt"):
        (tmp_path / name).write_bytes(b"PK\x03\x04 no archive \x89HDF")
        with pytest.raises(ImportSourceError, match=r"cannot be read|suffix"):
            import_source("mit", [tmp_path / name], tmp_path / "out")


# --- mit-square ---------------------------------------------------------------------------------------------------

SQUARE = {
    "row_id": [0, 7, 9],
    "c": [0.25, 1.0, 0.0],
    "beta": [0.1, -0.2, 0.3],
    "dx": [0.004, 0.003, 0.002],
    "dy": [0.001, -0.002, 0.0],
    "dtheta": [0.01, 0.02, -0.03],
    "push_group_est": [3, 3, 12],
}


def _square_csv(path: Path, columns: dict[str, list[float]] = SQUARE) -> Path:
    names = {"beta": "beta_rad", "dx": "dx_m", "dy": "dy_m", "dtheta": "dtheta_rad"}
    lines = [",".join(names.get(name, name) for name in columns)]
    lines += [",".join(map(str, row)) for row in zip(*columns.values(), strict=True)]
    path.write_bytes(gzip.compress("\n".join(lines).encode()))
    return path


def test_square_table_reverses_dy_and_uses_edge_0(tmp_path: Path) -> None:
    np.savez(tmp_path / "pushes_a.npz", **{name: np.array(column) for name, column in SQUARE.items()})
    sources = [tmp_path / "pushes_a.npz", _square_csv(tmp_path / "pushes_b.csv.gz")]
    report = import_source("mit-square", sources, tmp_path / "out")
    assert report.pushes == 4
    for name in ("pushes_a", "pushes_b"):
        table = read_table(tmp_path / "out" / f"{name}.csv")
        outline = load_rig(tmp_path / "out" / f"{name}.rig.yaml").outline
        edge, fraction = outline.edge(table.inputs[:, 1])
        assert edge.tolist() == [0, 0, 0]
        np.testing.assert_allclose(fraction, SQUARE["c"], atol=1e-12)
        np.testing.assert_allclose(table.inputs[:, 1], np.array(SQUARE["c"]) / 4, atol=1e-12)
        np.testing.assert_array_equal(table.inputs[:, [0, 2]], np.column_stack([[0.02] * 3, SQUARE["beta"]]))
        np.testing.assert_array_equal(table.outcomes[:, 1], -np.array(SQUARE["dy"]))
        assert table.push_id.tolist() == ["3", "3", "12"] and table.covariates["row_id"].tolist() == [0, 7, 9]


def test_invalid_square_table_is_rejected_with_line_or_index(tmp_path: Path) -> None:
    bad = {**SQUARE, "dx": [0.004, "x", 0.002]}
    with pytest.raises(ImportSourceError, match=r"csv\.gz line 3: column dx_m is 'x'"):
        import_source("mit-square", [_square_csv(tmp_path / "t.csv.gz", bad)], tmp_path / "out")
    with pytest.raises(ImportSourceError, match=r"c\[1\] is 1\.5"):
        import_source(
            "mit-square", [_square_csv(tmp_path / "t.csv.gz", {**SQUARE, "c": [0, 1.5, 1]})], tmp_path / "out"
        )
    np.savez(tmp_path / "nan.npz", **{**SQUARE, "dx": [0.004, np.nan, 0.002]})
    with pytest.raises(ImportSourceError, match=r"dx\[1\] is nan"):
        import_source("mit-square", [tmp_path / "nan.npz"], tmp_path / "out")
    np.savez(tmp_path / "less.npz", c=np.zeros(3))
    with pytest.raises(ImportSourceError, match="lacks beta"):
        import_source("mit-square", [tmp_path / "less.npz"], tmp_path / "out")
    whole = _square_csv(tmp_path / "t.csv.gz").read_bytes()
    (tmp_path / "t.csv.gz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ImportSourceError, match="cannot be read"):
        import_source("mit-square", [tmp_path / "t.csv.gz"], tmp_path / "out")
    assert not (tmp_path / "out").exists()


# --- mlab ---------------------------------------------------------------------------------------------------------


def _quaternion(yaw: float) -> str:
    return f"{np.cos(yaw / 2):.12f} 0 0 {np.sin(yaw / 2):.12f}"


def _mlab_push(start: float = 1.4e9, forces: int = 60, poses: int = 80, y: float = 75.0) -> list[str]:
    """The finger moves along -x of the world into the hypotenuse of a triangle rotated by 30 degrees."""
    yaw, turned = np.pi / 6, np.pi / 6 + 0.05
    tip_body = np.array([100.0, y - 25.0]) + 2.5 * np.array([1.0, 1.0]) / np.sqrt(2.0)
    tip = rotate(tip_body, np.array(yaw)) + np.array([600.0, 10.0])
    heading = rotate(np.array([-1.0, -1.0]) / np.sqrt(2.0), np.array(yaw))
    lines = [f"600 10 15 {_quaternion(yaw)}", f"{600 + 5 * heading[0]} {10 + 5 * heading[1]} 15 {_quaternion(turned)}"]
    lines += [str(forces)] + [f"{start + 0.01 * k} 0.1 {0.2 - (k > 20)}" for k in range(forces)]
    lines += [str(poses)]
    for k in range(poses):
        x, at = tip + heading * 0.1 * max(0, k - 10), start + 0.05 * k
        lines.append(f"{at} {x[0]} {x[1]} 12 {_quaternion(0.0)}")
    return lines


def _write_log(folder: Path, lines: list[str], name: str = "exp_1.txt") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text("\n".join(lines) + "\n")
    return folder / name


def test_velocity_times_duration_of_a_logged_push_is_its_travel_in_contact(tmp_path: Path) -> None:
    path = _write_log(tmp_path / "wood_30_90_30_30_30_90", ["1", *_mlab_push()])
    report = import_source("mlab", [path], tmp_path / "out")
    table = read_table(report.written[0])
    rig = load_rig(report.written[1])
    edge, fraction = rig.outline.edge(table.inputs[:, 1])
    assert report.pushes == len(table) == 1
    assert rig.surface == "plywood" and rig.support_points is not None
    np.testing.assert_allclose(rig.support_points, [[-0.02, -0.02, 1 / 3], [0.04, -0.02, 1 / 3], [-0.02, 0.04, 1 / 3]])
    assert edge.tolist() == [1] and fraction[0] == pytest.approx(1 / 3, abs=1e-6)
    assert table.inputs[0, 2] == pytest.approx(0.0, abs=1e-6)
    assert table.inputs[0, 0] == pytest.approx(0.1e-3 / 0.05, rel=1e-6)
    assert table.inputs[0, 0] * table.duration[0] == pytest.approx((69 * 0.1 - 2.5) * 1e-3, rel=1e-6)
    centroid_turn = rotate(np.array([0.05, 0.05]), np.array([np.pi / 6, np.pi / 6 + 0.05]))
    moved = rotate(centroid_turn[1] - centroid_turn[0], -table.covariates["push_heading"][0]) + [0.005, 0.0]
    np.testing.assert_allclose(table.outcomes[0], [*moved, 0.05], atol=1e-8)
    assert table.covariates["normal_force"][0] != 0.0


def test_irregularities_of_mlab_logs_are_reported(tmp_path: Path) -> None:
    away = _mlab_push(1.4e9 + 100.0)
    away[0] = away[0].replace("600 10", "603 10", 1)
    lines = ["5", *_mlab_push(), *_mlab_push(1.4e9 - 50.0, forces=0), *_mlab_push(1.4e9 + 50.0, 2, 2), *away]
    report = import_source("mlab", [_write_log(tmp_path / "old", [*lines, *_mlab_push()[:30]])], tmp_path / "out")
    table = read_table(report.written[0])
    text = "\n".join([*report.dropped, *report.repaired, *report.assumed])
    assert table.push_id.tolist() == ["old_exp_1/0", "old_exp_1/1", "old_exp_1/3"]
    np.testing.assert_allclose(table.covariates["elapsed_time"], [50.0, 0.0, 150.0], atol=1e-6)
    assert np.isnan(table.covariates["normal_force"]).tolist() == [False, True, False]
    for words in (
        "states 5 pushes, contains 4",
        "push 4 is cut off by the end",
        "push 2: 2 robot poses",
        "1 pushes without forces",
        "the clock goes back by 50 s",
        "moved by hand",
        "contains no configuration",
    ):
        assert words in text, words


def test_log_without_a_count_is_read_to_its_end(tmp_path: Path) -> None:
    report = import_source("mlab", [_write_log(tmp_path / "patch", [*_mlab_push(), *_mlab_push()])], tmp_path / "out")
    assert report.pushes == 2 and any("number of pushes is missing" in line for line in report.repaired)
    assert load_rig(report.written[1]).support_points is None


@pytest.mark.parametrize(
    ("line", "text", "words"),
    [
        (5, "1 2", ":5: '1 2', expected force: 3"),
        (5, "1 nan 2", ":5: '1 nan 2', expected force: 3 finite"),
        (5, "1 2 inf", ":5: '1 2 inf', expected force: 3 finite"),
        (5, "1 2 3 4", ":5: '1 2 3 4', expected force: 3 finite"),
        (5, "1 2 x", ":5: '1 2 x', expected force: 3 finite"),
        (4, "1.5", ":4: 1.5"),
        (4, "-1", ":4"),
        (2, "a b", ":2: 'a b'"),
    ],
)
def test_invalid_line_of_a_log_is_rejected_with_its_number(tmp_path: Path, line: int, text: str, words: str) -> None:
    lines = ["1", *_mlab_push()]
    lines[line - 1] = text
    with pytest.raises(ImportSourceError, match=words):
        import_source("mlab", [_write_log(tmp_path / "patch", lines)], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_load_shares_of_three_points_balance_the_weight() -> None:
    points = np.array([[-0.04, -0.04], [0.04, -0.02], [-0.04, 0.08]])
    np.testing.assert_allclose(load_shares(points), [0.25, 0.5, 0.25], atol=1e-12)
    np.testing.assert_allclose(load_shares(points) @ points, 0.0, atol=1e-12)


@given(st.floats(0.05, 0.95), st.integers(0, 2), st.floats(-1.0, 1.0), st.floats(0.001, 0.02))
def test_first_touch_is_where_the_path_meets_the_outline(fraction: float, edge: int, angle: float, away: float) -> None:
    outline = triangle()
    contact = np.array([float(outline.contact_on_edge(edge, fraction))])
    direction = rotate(outline.inward_normal(contact)[0], np.array(angle))
    found, share, reach = first_touch(outline, outline.point(contact)[0] - away * direction, direction)
    assert (found, share, reach) == (edge, pytest.approx(fraction, abs=1e-9), pytest.approx(away, abs=1e-9))


# --- mcube --------------------------------------------------------------------------------------------------------


def _write_mcube(folder: Path, tip_stop: int = 200) -> Path:
    """A block that the tip pushes along +y of the base at 50 mm/s from 1 s on; force along the contact normal."""
    folder.mkdir()
    stamp = 1_439_494_853_000_000_000 + 10_000_000 * np.arange(400)
    y = 0.05 * np.maximum(0.0, 0.01 * np.arange(400) - 1.0)
    half = np.sqrt(0.5)
    obj = [[t, -0.0358, -0.2 + d, 0.018, 0.0, 0.0, half] for t, d in zip(stamp, y, strict=True)]
    force = [[t, 0.1 - 2.0 * (d > 0.0), -2.1] for t, d in zip(stamp, y, strict=True)]
    tip = [[t + 15_000_000, 0.36, -0.251745 + d] for t, d in zip(stamp, y, strict=True)][:tip_stop]
    for kind, rows in (("obj", obj), ("ft", force), ("tcp", tip)):
        (folder / f"metal_1_{kind}.txt").write_text("".join(f"{value!s} \n" for row in rows for value in row))
    return folder


def test_mcube_run_has_one_frame_and_clock_and_a_force_against_the_push(tmp_path: Path) -> None:
    report = import_source("mcube", [_write_mcube(tmp_path / "St_block")], tmp_path / "out")
    recording = read_recording(report.written[0])
    rig, wrench = recording.rig, recording.wrench
    assert report.written[0].name == "St_block_metal_1" and rig is not None and wrench is not None
    pose = np.column_stack([recording.slider.x, recording.slider.y, np.unwrap(recording.slider.heading)])
    at = np.column_stack([np.interp(recording.pusher.stamp, recording.slider.stamp, column) for column in pose.T])
    touch = rig.outline.project(to_body(np.column_stack([recording.pusher.x, recording.pusher.y]), at))
    np.testing.assert_allclose(touch.distance - rig.pusher_radius, 0.0, atol=1e-4)
    pushing = wrench.stamp > wrench.stamp[0] + 1_500_000_000
    np.testing.assert_allclose(wrench.fy[pushing], -2.0, atol=1e-6)
    np.testing.assert_allclose(wrench.fx, 0.0, atol=1e-6)
    text = "\n".join([*report.dropped, *report.repaired, *report.assumed])
    for words in ("stops 2.0 s before", "15 ms late", "not measured", "surface unknown", "tared by 0.100, -2.100 N"):
        assert words in text, words


def test_invalid_mcube_file_is_rejected_with_its_line_and_a_truncated_one_is_reported(tmp_path: Path) -> None:
    folder = _write_mcube(tmp_path / "St_block")
    ft = folder / "metal_1_ft.txt"
    lines = ft.read_text().splitlines()
    ft.write_text("\n".join([*lines[:31], "oops", *lines[32:]]))
    with pytest.raises(ImportSourceError, match=r"metal_1_ft\.txt:32: 'oops'"):
        import_source("mcube", [folder], tmp_path / "out")
    ft.write_text("\n".join(lines[:-1]))
    report = import_source("mcube", [folder], tmp_path / "out")
    assert any("the last sample has 2 of 3 numbers" in line for line in report.dropped)
    ft.unlink()
    with pytest.raises(ImportSourceError, match=r"metal_1_ft\.txt"):
        import_source("mcube", [folder], tmp_path / "out2")


# --- all kinds ----------------------------------------------------------------------------------------------------


def test_import_overwrites_nothing_and_a_failure_writes_nothing(tmp_path: Path) -> None:
    good, out = _write_mit(tmp_path, _mit_streams()), tmp_path / "out"
    import_source("mit", [good], out)
    with pytest.raises(ImportSourceError, match="exists already"):
        import_source("mit", [good], out)
    assert [path.name for path in out.iterdir()] == [good.stem]
    with pytest.raises(ImportSourceError, match="two sources"):
        import_source("mit", [good, good], tmp_path / "out2")
    with pytest.raises(ImportSourceError, match="does not exist"):
        import_source("mit", [good, tmp_path / "absent.json"], tmp_path / "out2")
    assert not (tmp_path / "out2").exists()


def test_import_replaces_earlier_results_if_asked_but_no_folder_that_is_no_bag(tmp_path: Path) -> None:
    streams, out = _mit_streams(), tmp_path / "out"
    source = _write_mit(tmp_path, streams)
    (bag,) = import_source("mit", [source], out).written
    (bag / "metadata.yaml").write_text("earlier")
    assert import_source("mit", [source], out, overwrite=True).written == (bag,)
    assert (bag / "metadata.yaml").read_text() != "earlier"
    assert [path.name for path in out.iterdir()] == [bag.name]
    (bag / "notes.txt").write_text("not of a bag")
    with pytest.raises(RecordingError, match="exists and is not a bag"):
        import_source("mit", [source], out, overwrite=True)
    assert (bag / "notes.txt").exists() and [path.name for path in out.iterdir()] == [bag.name]
    rows = _square_csv(tmp_path / "t.csv.gz")
    table, rig = import_source("mit-square", [rows], out).written
    table.write_text("earlier")
    assert import_source("mit-square", [rows], out, overwrite=True).written == (table, rig)
    assert table.read_text() != "earlier"


def test_import_reports_the_share_of_the_files_that_is_done(tmp_path: Path) -> None:
    seen: list[float] = []
    sources = [_square_csv(tmp_path / f"{name}.csv.gz") for name in "ab"]
    import_source("mit-square", sources, tmp_path / "out", watch=lambda stage, fraction: seen.append(fraction))
    assert seen == [0.0, 0.5, 1.0]


def test_unknown_kind_and_missing_source_are_rejected(tmp_path: Path) -> None:
    with pytest.raises(ImportSourceError, match=r"'mitt'.*mit-square"):
        import_source("mitt", [tmp_path], tmp_path / "out")
    with pytest.raises(ImportSourceError, match="no source"):
        import_source("mit", [], tmp_path / "out")
    for kind in ("mit", "mit-square", "mlab", "mcube", "rosbag1"):
        with pytest.raises(ImportSourceError):
            import_source(kind, [tmp_path], tmp_path / "out")


def test_report_has_json_and_text(tmp_path: Path) -> None:
    report = import_source("mit", [_write_mit(tmp_path, _mit_streams())], tmp_path / "out")
    content = json.loads(json.dumps(report.to_json()))
    assert content["recordings"] == 1 and content["written"] == [str(report.written[0])]
    assert "assumed:" in str(report) and "dropped: nothing" in str(report)


def test_files_of_a_folder_are_found_in_order_and_what_is_missing_is_named(tmp_path: Path) -> None:
    for name in ("b/exp2.txt", "a/exp1.txt.gz", "a/other.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    found = sources_in([tmp_path, tmp_path / "a" / "other.txt"], "exp*.txt", "exp*.txt.gz")
    assert [path.name for path in found] == ["exp1.txt.gz", "exp2.txt", "other.txt"]
    with pytest.raises(ImportSourceError, match=r"/a: contains no \*\.bag"):
        sources_in([tmp_path / "a"], "*.bag")
    with pytest.raises(ImportSourceError, match=r"other\.txt: give a folder, or NAME_obj\.txt"):
        import_source("mcube", [tmp_path / "a" / "other.txt"], tmp_path / "out")


# --- repairs ----------------------------------------------------------------------------------------------------------


def _jumping(size: float, spread: int, at: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, the true heading and one with a jump of `size` over `spread` intermediate samples."""
    time = 0.004 * np.arange(120)
    true = 0.3 + 0.8 * time
    steps = np.clip((np.arange(120) - at + 1) / (spread + 1), 0.0, 1.0)
    return time, true, true + size * steps


@pytest.mark.parametrize("spread", [0, 2])
@pytest.mark.parametrize("quarters", [-1, 1, 2])
def test_heading_jump_by_quarter_turns_is_undone_on_a_square(quarters: int, spread: int) -> None:
    time, true, jumping = _jumping(quarters * np.pi / 2, spread)
    repair = repair_heading(time, jumping, symmetry=4)
    difference = (repair.heading - true)[repair.keep]
    assert repair.undone == 1 and repair.cut == 0
    assert np.sum(~repair.keep) == spread
    assert np.ptp(difference) < 0.05, "one heading, off by whole turns of the symmetry at most"


def test_heading_jump_against_the_symmetry_keeps_the_longer_piece() -> None:
    time, _, jumping = _jumping(np.pi / 2, spread=1, at=40)
    repair = repair_heading(time, jumping, symmetry=6)
    kept = np.flatnonzero(repair.keep)
    assert repair.cut == 1 and repair.undone == 0
    assert kept[0] >= 40 and kept[-1] == 119 and len(kept) == kept[-1] - kept[0] + 1


def test_ellipse_is_symmetric_under_half_turns_and_circle_under_all() -> None:
    for size, symmetry in ((np.pi, 2), (np.pi / 2, 0)):
        time, _, jumping = _jumping(size, spread=0)
        assert repair_heading(time, jumping, symmetry).undone == 1
    assert repair_heading(*_jumping(np.pi / 2, spread=0)[::2], 2).cut == 1


@given(st.floats(-12.0, 12.0), st.floats(-10.0, 10.0))
def test_continuous_heading_is_kept_over_many_turns(start: float, speed: float) -> None:
    time = 0.004 * np.arange(300)
    true = start + speed * time
    repair = repair_heading(time, wrap_angle(true), symmetry=4)
    assert np.all(repair.keep) and repair.undone == repair.cut == 0
    np.testing.assert_allclose(np.diff(repair.heading), np.diff(true), atol=1e-9)


def test_rows_are_sorted_without_repeated_stamps_and_both_are_reported() -> None:
    notes = Notes()
    samples = Samples(np.array([10, 30, 20, 20, 40]), np.array([[1.0], [3.0], [2.0], [9.0], [np.nan]]))
    clean = in_order(samples, "FILE", notes)
    assert clean.stamp.tolist() == [10, 20, 30] and clean.values[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert any("1 rows out of order" in line for line in notes.repaired)
    assert any("NaN or infinity" in line for line in notes.dropped) and any(
        "repeat the stamp" in line for line in notes.dropped
    )


def test_only_the_first_of_repeated_positions_is_kept() -> None:
    x = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 2.0, 3.0, 4.0, 4.0])
    kept = without_repeats(Samples(np.arange(14), x[:, None]), "tip", Notes())
    assert kept.stamp.tolist() == [0, 2, 4, 6, 8, 11, 12]


def test_rest_is_kept_in_a_stream_without_repeated_positions() -> None:
    x = np.concatenate([np.zeros(9), np.arange(1.0, 20.0), np.full(9, 19.0)])
    assert len(without_repeats(Samples(np.arange(37), x[:, None]), "tip", Notes()).stamp) == 37


@given(st.floats(1.0e9, 2.0e9))
def test_unix_seconds_keep_their_precision(seconds: float) -> None:
    assert abs(float(nanoseconds(np.array([seconds]))[0] / 10**9) - seconds) < 3e-7


@given(st.floats(-2.5, 2.5), st.floats(0.5, 3.0))
def test_heading_is_recovered_without_the_sign_of_qw(start: float, turned: float) -> None:
    true = np.linspace(start, start + turned, 600)
    quaternion = np.column_stack([np.zeros(600), np.zeros(600), np.sin(true / 2)])
    np.testing.assert_allclose(headings(quaternion), true, atol=1e-6)
