# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A step that count, distance and time explain alike becomes one of time; and the session of new data."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from made_up_traces import pushes
from synthetic import Push, translating_push

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.traced_session import Mark
from push_predictor.recordings.streams import Recording, WrenchStream
from push_predictor.recordings.table import INPUTS
from push_predictor.recordings.table_file import write_table
from push_predictor.recordings.write import write_recording
from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.evidence.loading import load_evidence
from push_predictor.residuals.extension.extended_model import by_the_clock

TABLE = pushes(20, 0)  # a push every 1000 / 19 s
STEP = DriverBasis("step", ("push_index",), place=7.5)
LATER = 100_000_000_000  # ns


def term(basis: DriverBasis, *covariates: str) -> Any:
    values = basis.values(TABLE.covariates, len(TABLE))
    best = Candidate("contact_friction", basis.drivers[0], basis, np.zeros((len(TABLE), 3, 1)), values)
    return cast("Any", SimpleNamespace(best=best, naming=SimpleNamespace(covariates=covariates)))


def test_step_that_time_explains_as_well_is_the_same_step_of_time() -> None:
    found = by_the_clock(term(STEP, "push_index", "elapsed_time"), TABLE)
    assert (found.covariate, found.basis.name) == ("elapsed_time", "step")
    assert found.basis.place == pytest.approx(7.5 * 1000.0 / 19.0)
    assert np.array_equal(found.basis.values(TABLE.covariates, len(TABLE)), STEP.values(TABLE.covariates, len(TABLE)))


@pytest.mark.parametrize(
    "unchanged",
    [
        term(STEP, "push_index", "slid_distance"),  # time was rejected
        term(DriverBasis("linear", ("push_index",), (9.5,), (5.0,)), "push_index", "elapsed_time"),
        term(DriverBasis("step", ("slider_x",), place=0.0), "slider_x", "elapsed_time"),
    ],
)
def test_every_other_effect_keeps_its_covariate(unchanged: Any) -> None:
    assert by_the_clock(unchanged, TABLE) is unchanged.best


def test_step_that_time_does_not_order_keeps_its_covariate() -> None:
    twice = replace(TABLE, covariates={**TABLE.covariates, "elapsed_time": TABLE.covariates["elapsed_time"] % 300.0})
    kept = term(STEP, "push_index", "elapsed_time")
    assert by_the_clock(kept, twice) is kept.best


# --- the session of new data -----------------------------------------------------------------------------------------


def saved(folder: Path, name: str, later: int) -> Path:
    """A recording of one push of 20 mm at 20 mm/s."""
    plain = translating_push(Push())
    slider, pusher = (replace(s, stamp=s.stamp + later) for s in (plain.slider, plain.pusher))
    force = plain.wrench
    wrench = None if force is None else WrenchStream(force.stamp + later, force.fx, force.fy, force.torque)
    moved: Recording = replace(plain, name=name, slider=slider, pusher=pusher, wrench=wrench)
    write_recording(folder / name, moved)
    return folder / name


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
    write_table(tmp_path / "pushes.csv", TABLE)
    session = load_evidence([tmp_path / "pushes.csv"], load_evidence([saved(tmp_path, "a", 0)]).rig).session
    assert session.origin is None and session.marks == ()
    assert session.now == pytest.approx({"elapsed_time": 1000.2, "push_index": 20.0})
