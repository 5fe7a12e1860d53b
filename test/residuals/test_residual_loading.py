# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Loading data to judge a model on: recordings and push tables, with every covariate by name, and their session."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_traces import pushes
from synthetic import Push, square_rig, translating_push

from push_predictor.errors import RecordingError, RigError
from push_predictor.models.effects.traced_session import Mark
from push_predictor.recordings.rig import save_rig
from push_predictor.recordings.streams import Recording, ScalarStream, WrenchStream
from push_predictor.recordings.table import INPUTS, PushTable
from push_predictor.recordings.table_file import write_table
from push_predictor.recordings.write import write_recording
from push_predictor.residuals.evidence.loading import cut_again, load_evidence

OF_A_RECORDING = {
    *("elapsed_time", "push_index", "slid_distance", "slider_x", "slider_y", "slider_heading", "push_heading"),
    *("velocity", "contact", "angle", "edge", "dwell_time", "time_since_contact", "contact_gap", "normal_force"),
    *("tangential_force", "free_force_x", "free_force_y", "recording"),
}
LATER = 100_000_000_000  # ns


def saved(folder: Path, name: str, later: int = 0, scalars: dict[str, ScalarStream] | None = None) -> Path:
    """A recording of one push of 1.1 s at 20 mm/s, that much later, as a bag."""
    write_recording(folder / name, replace(later_by(translating_push(Push()), later), name=name, scalars=scalars or {}))
    return folder / name


def later_by(recording: Recording, later: int) -> Recording:
    slider, pusher = (replace(s, stamp=s.stamp + later) for s in (recording.slider, recording.pusher))
    wrench = recording.wrench
    moved = None if wrench is None else WrenchStream(wrench.stamp + later, wrench.fx, wrench.fy, wrench.torque)
    return replace(recording, slider=slider, pusher=pusher, wrench=moved)


def warming(start: int, name: str = "/surface/temperature") -> dict[str, ScalarStream]:
    """A scalar topic that rises by one a second."""
    return {name: ScalarStream(start + 100_000_000 * np.arange(30, dtype=np.int64), 20.0 + 0.1 * np.arange(30.0))}


def rows(pushes: list[str], **covariates: list[float]) -> PushTable:
    n = len(pushes)
    inputs = np.column_stack([np.full(n, 0.02), np.linspace(0.1, 0.9, n), np.linspace(-0.5, 0.5, n)])
    columns = {name: np.array(values) for name, values in covariates.items()}
    return PushTable(inputs, np.full(n, 0.2), np.tile([0.004, 0.0, 0.01], (n, 1)), np.array(pushes), columns)


def saved_table(folder: Path, name: str, table: PushTable) -> Path:
    write_table(folder / f"{name}.csv", table)
    save_rig(square_rig(), folder / f"{name}.rig.yaml")
    return folder / f"{name}.csv"


def test_recordings_of_different_rigs_are_refused(tmp_path: Path) -> None:
    recording = translating_push(Push())
    assert recording.rig is not None
    other = replace(recording, name="other", rig=replace(recording.rig, pusher_radius=0.006))
    write_recording(tmp_path / "other", other)
    with pytest.raises(RigError, match="differ"):
        load_evidence([saved(tmp_path, "one"), tmp_path / "other"])


def test_recording_has_every_documented_covariate_and_its_scalar_topics(tmp_path: Path) -> None:
    start = int(translating_push().slider.stamp[0])
    loaded = load_evidence([saved(tmp_path, "one", scalars=warming(start))])
    assert set(loaded.table.covariates) == OF_A_RECORDING | {"topic:/surface/temperature"}
    assert loaded.dropped == {}
    assert loaded.recordings is not None
    assert len(loaded.recordings) == 1
    columns = loaded.table.covariates
    assert columns["topic:/surface/temperature"] - 20.0 == pytest.approx(columns["elapsed_time"], abs=0.01)
    assert np.diff(columns["slid_distance"]) == pytest.approx(0.004, abs=1e-4)
    assert np.array_equal(columns["velocity"], loaded.table.inputs[:, 0])
    assert np.array_equal(columns["angle"], loaded.table.inputs[:, 2])


def test_time_count_and_distance_continue_across_recordings_by_their_stamps(tmp_path: Path) -> None:
    second, first = saved(tmp_path, "a", later=LATER), saved(tmp_path, "b")
    table = load_evidence([second, first]).table  # given in the wrong order
    recording, columns = table.covariates["recording"], table.covariates
    early, late = (np.flatnonzero(recording == number) for number in (0.0, 1.0))
    assert np.all(np.diff(recording) >= 0.0)
    assert columns["elapsed_time"][late] - columns["elapsed_time"][early] == pytest.approx(100.0, abs=1e-6)
    assert columns["push_index"][early[0]] == 0.0
    assert columns["push_index"][late[0]] == 1.0
    assert columns["slid_distance"][late[0]] == pytest.approx(0.004 * len(early), abs=1e-4)


def test_drops_a_topic_that_one_recording_lacks_by_name(tmp_path: Path) -> None:
    start = int(translating_push().slider.stamp[0])
    paths = [saved(tmp_path, "a", scalars=warming(start)), saved(tmp_path, "b", later=LATER)]
    loaded = load_evidence(paths)
    assert "topic:/surface/temperature" not in loaded.table.covariates
    half = len(loaded.table) // 2
    assert loaded.dropped == {"topic:/surface/temperature": f"{half} of {2 * half} windows lack it"}


def test_push_table_keeps_its_columns_and_counts_pushes_in_order(tmp_path: Path) -> None:
    table = rows(["b", "b", "a", "c"], humidity=[0.1, 0.2, 0.3, 0.4])
    loaded = load_evidence([saved_table(tmp_path, "pushes", table)])
    assert loaded.recordings is None
    expected = {"push_index", "edge", "humidity", "velocity", "contact", "angle", "recording"}
    assert set(loaded.table.covariates) == expected
    assert loaded.table.covariates["push_index"].tolist() == [0.0, 0.0, 1.0, 2.0]
    assert loaded.table.covariates["edge"].tolist() == [0.0, 1.0, 2.0, 3.0]


def test_columns_of_a_table_take_precedence_and_one_with_an_empty_cell_is_dropped_by_name(tmp_path: Path) -> None:
    given = {"push_index": [7.0, 9.0], "recording": [3.0, 4.0], "edge": [2.0, 2.0], "slider_y": [0.1, 0.0]}
    loaded = load_evidence([saved_table(tmp_path, "pushes", rows(["a", "b"], **given, slider_x=[0.1, np.nan]))])
    assert {name: loaded.table.covariates[name].tolist() for name in given} == given
    assert loaded.dropped == {"slider_x": "1 of 2 windows lack it"}


def test_equal_push_ids_in_two_tables_are_two_pushes(tmp_path: Path) -> None:
    other = rows(["a", "b"])
    other.outcomes[:] += 0.001
    paths = [saved_table(tmp_path, "one", rows(["a", "b"])), saved_table(tmp_path, "two", other)]
    table = load_evidence(paths).table
    assert table.pushes == ["one.csv/a", "one.csv/b", "two.csv/a", "two.csv/b"]
    assert table.covariates["push_index"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert table.covariates["recording"].tolist() == [0.0, 0.0, 1.0, 1.0]


def test_cutting_corrected_streams_again_gives_the_same_columns(tmp_path: Path) -> None:
    loaded = load_evidence([saved(tmp_path, "a"), saved(tmp_path, "b", later=LATER)])
    assert loaded.recordings is not None
    again = cut_again(loaded.recordings, loaded.rig)
    assert np.array_equal(again.outcomes, loaded.table.outcomes)
    assert set(again.covariates) == set(loaded.table.covariates)
    shifted = [replace(r, pusher=replace(r.pusher, x=r.pusher.x + 0.0003)) for r in loaded.recordings]
    moved = cut_again(shifted, loaded.rig)
    assert np.any(np.abs(moved.covariates["contact_gap"].mean() - again.covariates["contact_gap"].mean()) > 1e-4)


def test_rejects_data_without_rig_or_pushes_by_name(tmp_path: Path) -> None:
    write_table(tmp_path / "bare.csv", rows(["a"]))
    with pytest.raises(RigError, match=r"bare\.csv"):
        load_evidence([tmp_path / "bare.csv"])
    still = replace(translating_push(Push(begin=5.0, end=5.1), tail=-4.0), name="still")
    write_recording(tmp_path / "still", still)
    with pytest.raises(RecordingError, match="still"):
        load_evidence([tmp_path / "still"])


# --- the session ------------------------------------------------------------------------------------------------------


def test_session_of_recordings_has_their_beginnings_and_the_values_after_the_last_window(tmp_path: Path) -> None:
    loaded = load_evidence([saved(tmp_path, "b", LATER), saved(tmp_path, "a", 0)])
    session, last = loaded.session, {name: column[-1] for name, column in loaded.table.covariates.items()}
    began = int(translating_push(Push()).slider.stamp[0])
    assert [mark.stamp - began for mark in session.marks[:2]] == pytest.approx([0, LATER], abs=2_000_000)
    assert session.origin == session.marks[0].stamp and session.marks[0] == Mark(session.marks[0].stamp, 0.0, 0.0)
    assert session.marks[1].pushes == 1.0 and session.marks[1].slid == pytest.approx(last["slid_distance"] / 2, rel=0.2)
    travel = np.hypot(*loaded.table.outcomes[-1, :2])
    assert session.now == pytest.approx(
        {
            "elapsed_time": last["elapsed_time"] + loaded.table.duration[-1],
            "push_index": 2.0,
            "slid_distance": last["slid_distance"] + travel,
        }
    )
    end = session.marks[-1]
    assert (end.pushes, end.slid) == (2.0, session.now["slid_distance"])
    assert (end.stamp - began) * 1e-9 == pytest.approx(session.now["elapsed_time"], abs=0.002)


def test_each_traced_recording_and_its_table_keep_their_place_in_the_session(tmp_path: Path) -> None:
    both = [saved(tmp_path, "a", 0), saved(tmp_path, "b", LATER)]
    loaded = load_evidence(both)
    second = load_evidence(both[1:])
    expected = loaded.table.take(loaded.table.covariates["recording"] == 1.0).covariates
    columns = {name: c for name, c in second.table.covariates.items() if name not in INPUTS}
    write_table(tmp_path / "pushes.csv", replace(second.table, covariates=columns))
    of_table = load_evidence([tmp_path / "pushes.csv"], second.rig)
    for table in (second.table, of_table.table):
        found = loaded.session.continued(table).covariates
        for name in ("elapsed_time", "push_index", "slid_distance"):
            assert found[name] == pytest.approx(expected[name], abs=2e-3 if name == "elapsed_time" else 1e-9), name
    assert of_table.session.marks == second.session.marks


def test_session_of_a_table_without_stamps_has_values_alone(tmp_path: Path) -> None:
    write_table(tmp_path / "pushes.csv", pushes(20, 0))
    session = load_evidence([tmp_path / "pushes.csv"], load_evidence([saved(tmp_path, "a", 0)]).rig).session
    assert session.origin is None and session.marks == ()
    assert session.now == pytest.approx({"elapsed_time": 1000.2, "push_index": 20.0})
