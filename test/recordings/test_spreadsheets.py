# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""CSV streams and push tables as spreadsheets write them: read as plain ones, or refused with what to change."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from square_session import pushes

from push_predictor.errors import RecordingError, TableError
from push_predictor.recordings.bag.spreadsheet import UNITS, cells_of, column_of
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table_file import read_table, write_table

PLAIN = {
    "slider": "time,x,y,z,heading\n0.5,0.001,-0.25,0.5,-1.5\n1.25,0.002,-0.5,0.25,-0.125\n",
    "pusher": "time,x,y,z,heading\n0.5,0.125,0,0,0\n1.5,0.25,0,0,0.1\n",
    "wrench": "time,fx,fy,torque\n0.5,1.5,-2.5,0.25\n1.5,1e-5,2.0,0.5\n",
}


def comma(text: str) -> str:
    """With semicolons and decimal commas."""
    return text.replace(",", ";").replace(".", ",")


def quoted(text: str) -> str:
    """With commas, and quotes around each cell."""
    return "\n".join(",".join(f'"{cell}"' for cell in row.split(";")) for row in text.split("\n"))


def as_bytes(text: str) -> bytes:
    return text.encode()


WAYS: dict[str, Callable[[str], bytes]] = {
    "semicolons and commas": lambda text: as_bytes(comma(text)),
    "semicolons and points": lambda text: as_bytes(text.replace(",", ";")),
    "tabs": lambda text: as_bytes(comma(text).replace(";", "\t")),
    "mark and CRLF": lambda text: ("\ufeff" + comma(text)).replace("\n", "\r\n").encode(),
    "UTF-16 with tabs": lambda text: comma(text).replace(";", "\t").replace("\n", "\r\n").encode("utf-16"),
    "capitals": lambda text: as_bytes(text.partition("\n")[0].title() + "\n" + text.partition("\n")[2]),
    "quoted": lambda text: as_bytes(quoted(comma(text))),
    "empty columns and rows": lambda text: as_bytes(comma(text).replace("\n", ";;\n") + ";;;\n\n"),
    "sep=": lambda text: as_bytes("sep=;\n" + comma(text)),
    "numpy": lambda text: as_bytes("# " + text),
    "other order": lambda text: as_bytes("\n".join(",".join(row.split(",")[::-1]) for row in text.split("\n"))),
    "units": lambda text: as_bytes(text.replace("time", "time [s]").replace("fx", "Fx (N)").replace("x,", "x [m],", 1)),
}


def written(folder: Path, as_written: Callable[[str], bytes], suffix: str = ".csv") -> Path:
    folder.mkdir()
    for name, text in PLAIN.items():
        (folder / f"{name}{suffix}").write_bytes(as_written(text))
    return folder


def numbers(recording: Recording) -> list[list[float]]:
    slider, pusher, wrench = recording.slider, recording.pusher, recording.wrench
    assert wrench is not None
    columns = [slider.x, slider.y, slider.z, slider.heading, pusher.x, wrench.fx, wrench.fy, wrench.torque]
    return [column.tolist() for column in (slider.stamp, pusher.stamp, wrench.stamp, *columns)]


@pytest.mark.parametrize("way", WAYS)
def test_each_way_of_writing_gives_the_numbers_of_the_plain_file(tmp_path: Path, way: str) -> None:
    plain = read_recording(written(tmp_path / "plain", as_bytes))
    found = read_recording(written(tmp_path / "other", WAYS[way]))
    assert numbers(found) == numbers(plain)
    assert found.slider.stamp.tolist() == [500_000_000, 1_250_000_000] and found.notes == plain.notes


def test_names_of_files_may_have_capitals(tmp_path: Path) -> None:
    folder = written(tmp_path / "a", as_bytes, ".CSV")
    (folder / "slider.CSV").rename(folder / "Slider.csv")
    assert numbers(read_recording(folder)) == numbers(read_recording(written(tmp_path / "b", as_bytes)))


def test_units_in_the_header_are_converted_and_noted(tmp_path: Path) -> None:
    folder = written(tmp_path / "a", as_bytes)
    (folder / "slider.csv").write_text(
        "time [ms];X [mm];y (cm);z [m];Heading [°]\n500;1;-25;0,5;-90\n1250;2;-50;0,25;45\n"
    )
    (folder / "wrench.csv").write_text(
        "time [us],fx [mN],fy [kN],torque [Nmm]\n500000,1500,-0.0025,250\n1500000,0,0,0\n"
    )
    found = read_recording(folder)
    assert found.wrench is not None
    assert found.slider.stamp.tolist() == [500_000_000, 1_250_000_000]
    np.testing.assert_allclose(found.slider.x, [0.001, 0.002])
    np.testing.assert_allclose(found.slider.y, [-0.25, -0.5])
    np.testing.assert_allclose(found.slider.z, [0.5, 0.25])
    np.testing.assert_allclose(found.slider.heading, [-0.5 * np.pi, 0.25 * np.pi])
    np.testing.assert_allclose([found.wrench.fx[0], found.wrench.fy[0], found.wrench.torque[0]], [1.5, -2.5, 0.25])
    assert found.wrench.stamp.tolist() == [500_000_000, 1_500_000_000]
    assert "slider.csv: time in ms, x in mm, y in cm, heading in ° is converted to SI units" in found.notes
    assert not found.losses


def test_the_columns_of_other_files_keep_their_names(tmp_path: Path) -> None:
    folder = written(tmp_path / "a", as_bytes)
    (folder / "Table.csv").write_text("Time [ms];Heat [C]\n500;20,5\n")
    scalar = read_recording(folder).scalars["/Table/Heat [C]"]
    assert (scalar.stamp.tolist(), scalar.value.tolist()) == ([500_000_000], [20.5])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"time,x [inch],y,z,heading\n1,2,3,4,5\n", r"line 1: column 'x \[inch\]' has an unknown unit, give m, cm, mm"),
        (b"time,x,y,z,heading [Nm]\n1,2,3,4,5\n", r"line 1: column 'heading \[Nm\]' has an unknown unit, give rad"),
        (b"time;x;y;z;heading\n1,5;2;3;4;5\n1.5;2;3;4;5\n", "line 2: column time is '1,5', give s .* with a decimal"),
        (b"time;x;y;z;heading\n1;2;3;4;5\n1;2,5;3.5;4;5\n", "line 3: column x is '2,5', give a number with a decimal"),
        (b"time;x;y;z;heading\n1;1.234,5;3;4;5\n", r"line 2: column x is '1\.234,5', give a number with a decimal"),
        (b"time,x,y,z,heading\n0,5,1,2,3,4,5\n", "line 2: 7 cells, the header has 5; numbers with a decimal comma"),
        (b"time,x,y,z,heading\n1,2,3,4\n", "line 2: 4 cells, the header has 5$"),
        (b"time;x;y;z\n1;2;3;4\n", "line 1: the header is 'time,x,y,z', give 'time,x,y,z,qx"),
        (b"time,x,y,z,heading,heading\n1,2,3,4,5,6\n", "line 1: the header is"),
        ("zeit;x;y;z;höhe\n1;2;3;4;5\n".encode("cp1252"), "cannot be read as CSV .it is not UTF-8 text; save"),
        (b"0,1;2;3;4;5\n0,2;2;3;4;5\n", "line 1: the header is '0,1,2,3,4,5', give 'time,x,y,z,qx"),
    ],
)  # fmt: skip
def test_what_cannot_be_understood_is_refused_with_what_to_change(tmp_path: Path, text: bytes, message: str) -> None:
    folder = written(tmp_path / "a", as_bytes)
    (folder / "slider.csv").write_bytes(text)
    with pytest.raises(RecordingError, match=rf"slider\.csv:? {message}"):
        read_recording(folder)


def test_a_folder_with_a_spreadsheet_is_refused_with_what_to_save(tmp_path: Path) -> None:
    (tmp_path / "monday.xlsx").write_bytes(b"PK")
    with pytest.raises(RecordingError, match=r"save the sheets of monday\.xlsx as these CSV files"):
        read_recording(tmp_path)


def test_cells_with_commas_stay_where_some_have_points() -> None:
    assert cells_of(b"a;b\n1,5;2.5\n") == [(1, ["a", "b"]), (2, ["1,5", "2.5"])]
    assert cells_of(b"a;b\n1,5;push.1\n,5;-2,5e-3\n")[1:] == [(2, ["1.5", "push.1"]), (3, [".5", "-2.5e-3"])]
    assert cells_of(b"a,b\n1.5,2\n") == [(1, ["a", "b"]), (2, ["1.5", "2"])]
    assert cells_of(b"a\n1,5\n") == [(1, ["a"]), (2, ["1", "5"])]
    assert cells_of(b"") == [] and cells_of(b"\n;;\n") == []


def test_every_unit_of_a_column_is_the_si_unit_times_its_factor() -> None:
    for name, units in UNITS.items():
        assert column_of(f"{name.upper()} [ {next(iter(units))} ]") == (name, next(iter(units)), 1)
    assert float(column_of("heading (deg)").factor) == np.pi / 180.0
    assert column_of("Wind [bft]") == ("wind [bft]", "", 1) and column_of("x") == ("x", "", 1)


def test_a_push_table_of_a_spreadsheet_is_the_plain_one(tmp_path: Path) -> None:
    table = pushes(3, 1)
    write_table(tmp_path / "a.csv", table)
    text = (tmp_path / "a.csv").read_text()
    (tmp_path / "b.csv").write_bytes(("\ufeff" + comma(text).replace("velocity", "Velocity")).encode())
    found = read_table(tmp_path / "b.csv")
    assert found.inputs.tolist() == table.inputs.tolist() and found.outcomes.tolist() == table.outcomes.tolist()
    (tmp_path / "c.csv").write_text("velocity;contact\n0,1;0,2\n")
    with pytest.raises(TableError, match="lacks column angle, duration"):
        read_table(tmp_path / "c.csv")
