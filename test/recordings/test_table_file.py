# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Push tables as CSV: they read back exactly; an error names file, line, column, value and what is accepted."""

from __future__ import annotations

import gzip
import tempfile
from dataclasses import replace
from pathlib import Path

import hypothesis.extra.numpy as arrays
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from push_predictor.errors import RecordingError, RigError, TableError
from push_predictor.geometry.shapes import shape_outline
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.rig import Rig, save_rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import is_recording, read_table, rig_of_table, write_table
from push_predictor.recordings.write import write_recording

HEADER = "velocity,contact,angle,duration,dx,dy,dtheta,push_id"
GOOD = "0.02,0.25,-0.1,0.2,0.003,-0.0001,0.02,a"


def written(path: Path, *rows: str, header: str = HEADER) -> Path:
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


@st.composite
def tables(draw: st.DrawFn) -> PushTable:
    n = draw(st.integers(1, 8))
    finite = st.floats(allow_nan=False, allow_infinity=False)

    def column(elements: st.SearchStrategy[float]) -> np.ndarray:
        return draw(arrays.arrays(np.float64, n, elements=elements))

    above = st.floats(1e-9, 1e9)
    inputs = [column(above), column(st.floats(0.0, 1.0, exclude_max=True)), column(st.floats(-1.57, 1.57))]
    words = st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"]), min_size=1)
    ids = np.array(draw(st.lists(words, min_size=n, max_size=n)))
    outcomes = np.stack([column(finite) for _ in range(3)], axis=1)
    return PushTable(np.stack(inputs, axis=1), column(above), outcomes, ids, {"warmth, mean": column(finite)})


@settings(max_examples=12, deadline=None)
@given(tables(), st.sampled_from(["a.csv", "a.csv.gz"]))
def test_table_reads_back_to_the_same_numbers(table: PushTable, name: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        write_table(Path(folder) / name, table)
        read = read_table(Path(folder) / name)
    for field in ("inputs", "duration", "outcomes", "push_id"):
        np.testing.assert_array_equal(getattr(read, field), getattr(table, field), err_msg=field)
    np.testing.assert_array_equal(read.covariates["warmth, mean"], table.covariates["warmth, mean"])


def test_same_table_gives_the_same_bytes(tmp_path: Path) -> None:
    table = read_table(written(tmp_path / "a.csv", GOOD))
    for name in ("b.csv.gz", "c.csv.gz"):
        write_table(tmp_path / name, table)
    assert (tmp_path / "b.csv.gz").read_bytes() == (tmp_path / "c.csv.gz").read_bytes()
    assert gzip.decompress((tmp_path / "b.csv.gz").read_bytes()).decode().startswith(HEADER)


@pytest.mark.parametrize(
    ("column", "value", "accepted"),
    [
        ("velocity", "0", "a number above 0, m/s"),
        ("velocity", "-0.02", "a number above 0, m/s"),
        ("velocity", "fast", "a number above 0, m/s"),
        ("contact", "1", "a number from 0 to below 1"),
        ("contact", "-0.01", "a number from 0 to below 1"),
        ("angle", "1.5708", "a number above -pi/2 and below pi/2, rad"),
        ("angle", "nan", "a number above -pi/2 and below pi/2, rad"),
        ("duration", "0", "a number above 0, s"),
        ("duration", "inf", "a number above 0, s"),
        ("dx", "nan", "a finite number"),
        ("dy", "", "a finite number"),
        ("dtheta", "-inf", "a finite number"),
        ("push_id", "", "a name, the same for all windows of one push"),
    ],
)
def test_invalid_value_is_rejected_by_name(tmp_path: Path, column: str, value: str, accepted: str) -> None:
    cells = dict(zip(HEADER.split(","), GOOD.split(","), strict=True)) | {column: value}
    path = written(tmp_path / "a.csv", GOOD, "", ",".join(cells.values()))
    with pytest.raises(TableError) as raised:
        read_table(path)
    assert str(raised.value) == f"{path} line 4: column {column} is {value!r}, give {accepted}"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (f"{HEADER}\n{GOOD}\n0.02,0.25\n", "line 3: 2 cells, the header has 8"),
        (f"{HEADER}\n{GOOD},5\n", "line 2: 9 cells, the header has 8"),
        ("velocity,contact\n0.02,0.25\n", "line 1: lacks column angle, duration, dx, dy, dtheta, push_id"),
        (f"{HEADER},dx\n{GOOD},1\n", "line 1: a column occurs twice"),
        (f"{HEADER}\n", "contains no rows"),
        ("", "contains no rows"),
        (f"{HEADER},warmth\n{GOOD},1.5\n{GOOD},warm\n", "line 3: column warmth is 'warm', give a number"),
        (b"\xff\xfe\x00", "cannot be read as CSV"),
        (b"\x1f\x8b\x08\x00cut", "cannot be read as CSV"),
    ],
)
def test_file_without_a_table_is_rejected_by_name(tmp_path: Path, content: str | bytes, reason: str) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(TableError) as raised:
        read_table(path)
    assert str(raised.value).startswith(str(path)) and reason in str(raised.value)


def test_missing_file_is_rejected_by_name(tmp_path: Path) -> None:
    with pytest.raises(TableError, match=r"absent\.csv: cannot be read"):
        read_table(tmp_path / "absent.csv")


def test_further_numeric_columns_are_covariates_and_text_is_ignored(tmp_path: Path) -> None:
    """Columns can be in any order; an empty cell of a covariate is unknown; a byte order mark is accepted."""
    header = "\ufeffoperator,warmth,push_id,dtheta,dy,dx,duration,angle,contact,velocity"
    rows = [f"Ann,{warmth},p,0.3,0.2,0.1,0.5,-1,0.75,0.04" for warmth in ("21.5", "", "nan")]
    path = written(tmp_path / "a.csv", *rows, header=header)
    table = read_table(path)
    np.testing.assert_array_equal(table.inputs[0], [0.04, 0.75, -1.0])
    np.testing.assert_array_equal(table.outcomes[0], [0.1, 0.2, 0.3])
    assert set(table.covariates) == {"warmth"}
    np.testing.assert_array_equal(table.covariates["warmth"], [21.5, np.nan, np.nan])


def test_recordings_and_tables_are_distinguished_by_path(tmp_path: Path) -> None:
    assert is_recording(tmp_path) and is_recording(tmp_path / "a.mcap")
    assert not is_recording(tmp_path / "a.csv") and not is_recording(tmp_path / "a.csv.gz")


@pytest.mark.parametrize("name", ["a.b.csv", "a.b.csv.gz"])
def test_rig_of_a_table_is_read_from_its_rig_yaml(tmp_path: Path, rig: Rig, name: str) -> None:
    assert rig_of_table(tmp_path / name) is None
    with pytest.raises(RigError, match=r"a\.b\.csv.*: no push_rig in .*a\.b\.rig\.yaml; give it with --rig"):
        load_rig_for([tmp_path / name])
    save_rig(rig, tmp_path / "a.b.rig.yaml")
    assert load_rig_for([tmp_path / name]).to_record() == rig.to_record()


def test_rigs_of_several_data_must_have_the_same_geometry(tmp_path: Path, recording: Recording, rig: Rig) -> None:
    write_recording(tmp_path / "square", recording)
    write_recording(tmp_path / "on_delrin", replace(recording, rig=replace(rig, surface="delrin")))
    hexagon = replace(rig, shape="hex", outline=shape_outline("hex"))
    write_recording(tmp_path / "hexagon", replace(recording, rig=hexagon))
    same = [tmp_path / "square", tmp_path / "on_delrin"]
    assert load_rig_for(same).surface == "plywood"
    with pytest.raises(RigError, match=r"hexagon: outline or pusher \(hex\) differ"):
        load_rig_for([*same, tmp_path / "hexagon"])


def test_different_pushes_stay_different_and_copies_stay_one(tmp_path: Path) -> None:
    first = written(tmp_path / "first.csv", GOOD)
    copy = written(tmp_path / "copy.csv", GOOD)
    other = written(tmp_path / "other.csv", GOOD.replace("0.25", "0.5"))
    assert load_data([first, copy]).pushes == ["a"]
    assert load_data([first, other]).pushes == ["first.csv/a", "other.csv/a"]


def test_recording_loads_as_the_table_of_its_windows(tmp_path: Path, recording: Recording, rig: Rig) -> None:
    write_recording(tmp_path / "push", recording)
    table = load_data([tmp_path / "push"])
    assert len(table) > 0
    np.testing.assert_allclose(table.inputs[:, 0], 0.02, rtol=1e-9)
    write_table(tmp_path / "push.csv", table)
    both = load_data([tmp_path / "push", tmp_path / "push.csv"])
    assert len(both) == 2 * len(table) and both.pushes == table.pushes
    write_recording(tmp_path / "bare", replace(recording, rig=None))
    with pytest.raises(RigError, match="no push_rig record"):
        load_data([tmp_path / "bare"])
    np.testing.assert_array_equal(load_data([tmp_path / "bare"], rig).outcomes, table.outcomes)


def test_data_without_a_push_are_rejected_by_name(tmp_path: Path, recording: Recording) -> None:
    away = replace(recording, pusher=replace(recording.pusher, x=recording.pusher.x - 1.0), wrench=None)
    write_recording(tmp_path / "away", away)
    with pytest.raises(RecordingError, match="away: no push was found"):
        load_data([tmp_path / "away"])
    with pytest.raises(TableError, match="no push table was given"):
        load_data([])
