# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A folder of CSV files with stated headers is a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")
from lab_bags import pose_rows
from test_lab_topics import assert_same_windows, original

from push_predictor.errors import RecordingError
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import Recording


def lines(header: str, stamps: np.ndarray, columns: np.ndarray) -> str:
    rows = (
        f"{stamp // 10**9}.{stamp % 10**9:09d},{','.join(map(repr, row))}"
        for stamp, row in zip(stamps.tolist(), columns.tolist(), strict=True)
    )
    return "\n".join([header, *rows, ""])


def write(folder: Path, *, planar: bool) -> Path:
    folder.mkdir()
    found: Recording = original()
    for name, stream in (("slider", found.slider), ("pusher", found.pusher)):
        columns = np.column_stack([stream.x, stream.y, stream.z, stream.heading]) if planar else pose_rows(stream)
        header = "time,x,y,z,heading" if planar else "time,x,y,z,qx,qy,qz,qw"
        (folder / f"{name}.csv").write_text(lines(header, stream.stamp, columns))
    assert found.wrench is not None
    fx, fy, torque, none = found.wrench.fx, found.wrench.fy, found.wrench.torque, np.zeros(len(found.wrench))
    columns = np.column_stack([fx, fy, torque] if planar else [fx, fy, none, none, none, torque])
    header = "time,fx,fy,torque" if planar else "time,fx,fy,fz,tx,ty,tz"
    (folder / "wrench.csv").write_text(lines(header, found.wrench.stamp, columns))
    return folder


@pytest.mark.parametrize("planar", [True, False])
def test_csv_streams_give_the_windows_of_the_original(tmp_path: Path, planar: bool) -> None:
    found = read_recording(write(tmp_path / "lab", planar=planar), rig=original().rig)
    assert found.slider.stamp.tolist() == original().slider.stamp.tolist()
    assert_same_windows(found)


def test_columns_of_further_files_are_scalars_and_empty_cells_are_discarded(tmp_path: Path) -> None:
    path = write(tmp_path / "lab", planar=True)
    second = int(original().slider.stamp[0]) // 10**9
    (path / "table.csv").write_text(f"time,heat,damp\n{second}.5,20,0.5\n{second + 1}.5,,0.6\n")
    found = read_recording(path)
    assert found.scalars["/table/heat"].value.tolist() == [20.0]
    assert found.scalars["/table/damp"].stamp.tolist() == [second * 10**9 + 500_000_000, second * 10**9 + 1_500_000_000]
    assert "/table/heat: 1 samples contain NaN or infinity; discarded" in found.notes


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("slider", "t,x,y\n1,2,3\n", "line 1: the header is 't,x,y', give 'time,x,y,z,qx,qy,qz,qw' or 'time,x"),
        ("wrench", "time,fx\n1,2\n", "line 1: the header is 'time,fx', give 'time,fx,fy,fz,tx,ty,tz' or 'time,fx"),
        ("heat", "t,heat\n1,2\n", "line 1: the header is 't,heat', give time and further columns"),
        ("pusher", "time,x,y,z,heading\n1,2,3,4\n", "line 2: 4 cells, the header has 5"),
        ("pusher", "time,x,y,z,heading\n1,2,3,4,a\n", "line 2: column heading is 'a', give a number, or leave"),
        ("pusher", "time,x,y,z,heading\n-1,2,3,4,5\n", "line 2: column time is '-1', give s from 0 to 2147483648"),
        ("pusher", "time,x,y,z,heading\nnoon,2,3,4,5\n", "line 2: column time is 'noon', give s"),
        ("pusher", "time,x,y,z,heading\n1e99999,2,3,4,5\n", "line 2: column time is '1e99999', give s"),
        ("pusher", "", "contains no rows, give a header and one row for each sample"),
        ("pusher", "time,x,y,z,heading\n\"1,2", "cannot be read as CSV"),
    ],
)  # fmt: skip
def test_a_wrong_csv_names_file_line_column_value_and_what_is_accepted(
    tmp_path: Path, name: str, text: str, message: str
) -> None:
    path = write(tmp_path / "lab", planar=True)
    (path / f"{name}.csv").write_text(text)
    with pytest.raises(RecordingError, match=rf"{name}\.csv:? {message}"):
        read_recording(path)


def test_a_folder_without_both_streams_is_no_recording(tmp_path: Path) -> None:
    path = write(tmp_path / "lab", planar=True)
    (path / "pusher.csv").unlink()
    with pytest.raises(RecordingError, match=r"no \.bag, and not both slider\.csv and pusher\.csv"):
        read_recording(path)


def test_a_parquet_file_is_noted(tmp_path: Path) -> None:
    path = write(tmp_path / "lab", planar=True)
    (path / "heat.parquet").write_bytes(b"PAR1")
    assert "heat.parquet is ignored, convert it to CSV" in read_recording(path).notes
