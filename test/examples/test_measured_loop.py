# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The residual loop on measured pushes: its report, the skip without data, and a whole loop through the nodes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from ros_harness import free_domain

from examples import measured_loop, measured_recordings
from examples.loop import ClosedLoop, Traced
from examples.loop_picture import DEPLOYED, EXTENDED, Story
from examples.measured_loop import REFIT, Outcome, main, to_json, to_text
from examples.measured_recordings import Split, mcube_splits, mlab_splits
from push_predictor.evaluation.validation import Comparison
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import read_table
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions

EFFECT = {
    "mechanism": "pressure_spread",
    "covariate": "model_inputs",
    "form": "constant",
    "parameter": {"value": -0.7, "low": -0.8, "high": -0.5, "unit": "1"},
}


def comparison(error: float, pushes: int) -> Comparison:
    """Three windows a push whose predictions are off by about `error`; the deviation is predicted right."""
    rng = np.random.default_rng(0)
    n = 3 * pushes
    off = error * rng.normal(size=(n, 3))
    observed = rng.normal(size=(n, 3))
    ids = np.repeat([f"push-{k}" for k in range(pushes)], 3)
    covariance = np.tile(error**2 * np.eye(3), (n, 1, 1))
    return Comparison("m", 10, ids, observed + off, covariance, observed, None, np.zeros(3))


def outcome(recording: Recording, later: dict[str, float], pushes: int = 20) -> Outcome:
    """The outcome of a loop; later: the error of each model on the later pushes."""
    split = Split("mlab one to two", recording, recording, recording, "a support was changed")
    traced = Traced("", {"verdict": "mechanism_only", "effects": [EFFECT]}, None)
    closed = ClosedLoop(Story({}, {}, 30, None), None, traced, "")
    counts = {"training": (50, 1000), "traced": (1, 15), "later": (pushes, 3 * pushes)}
    alarm = {"fired": False, "pushes": 30, "log10_evidence": 0.9, "off": None}
    return Outcome(split, counts, alarm, closed, {name: comparison(error, pushes) for name, error in later.items()})


# --- the report -------------------------------------------------------------------------------------------------


def test_extension_that_beats_both_models_on_later_pushes_is_called_better(recording: Recording) -> None:
    found = outcome(recording, {DEPLOYED: 0.5, REFIT: 0.4, EXTENDED: 0.1})
    assert to_text(found).startswith("mlab one to two. The extended model is better on the later pushes.")
    values = to_json(found)["differences"]["extended − refit"]["nlpd"]
    assert values["low"] <= values["value"] <= values["high"] < 0.0


def test_one_later_push_has_no_interval(recording: Recording) -> None:
    found = outcome(recording, {DEPLOYED: 0.5, REFIT: 0.4, EXTENDED: 0.1}, pushes=1)
    assert "(one push)" in to_text(found)
    assert to_json(found)["later"][DEPLOYED]["nmse"]["low"] is None
    assert "no certain gain" in to_text(found)
    json.dumps(to_json(found), allow_nan=False)


# --- the command ------------------------------------------------------------------------------------------------


def test_without_the_data_it_states_which_folder_is_absent_and_succeeds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--data", str(tmp_path / "absent"), "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert said.count("SKIPPED") == 2 and str(tmp_path / "absent" / "mlab") in said and "--data FOLDER" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_steel_block_runs_through_the_nodes_and_is_too_short_for_a_trace(
    measured_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each run is one push; the trace needs twelve. The replays, the validations and the report work all the same."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(free_domain()))
    monkeypatch.setitem(measured_loop.RATES, "mcube", (20.0, 20.0))
    assert main(["--data", str(measured_data), "--kind", "mcube", "--only", "steel", "--out", str(tmp_path)]) == 0
    (found,) = json.loads((tmp_path / "measured_loop.json").read_text())
    assert [part["pushes"] for part in found["split"].values()] == [2, 1, 1]
    assert found["alarm"]["off"] and "at least 12" in found["trace"]["failed"]
    online, offline = (found["later"][name]["nmse"]["value"] for name in (DEPLOYED, REFIT))  # the same mean
    assert online == pytest.approx(offline, rel=1e-6) and 0.0 < online < 1.0
    assert "Nothing was found" in capsys.readouterr().out


# --- measured recordings ----------------------------------------------------------------------------------------------


WOOD = "mlab wood_patch to wood_30_90_30_30_30_90"
MIXED = "30_90_30_30_30_90"  # of the log that joins two sessions, the later one first


@pytest.fixture(scope="module", autouse=True)
def logs_are_read_once() -> Iterator[None]:
    """Their splits differ in where they are cut."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measured_recordings, "_read", cache(measured_recordings._read))
        yield


@pytest.fixture(scope="module")
def blocks(measured_data: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Split]:
    return {split.name: split for split in mcube_splits(measured_data, tmp_path_factory.mktemp("mcube"))}


@pytest.fixture(scope="module")
def logs(measured_data: Path) -> dict[str, Split]:
    return {split.name: split for split in mlab_splits(measured_data)}


@pytest.fixture(scope="module")
def table(measured_data: Path, tmp_path_factory: pytest.TempPathFactory) -> PushTable:
    """The whole pushes of the log wood_30_90, as the importer has them."""
    source = measured_data / "mlab" / "sensor_log" / "wood_30_90_30_30_30_90"
    written = import_source("mlab", [source], tmp_path_factory.mktemp("table")).written
    return read_table(next(path for path in written if path.suffix == ".csv"))


def windows_of(recording: Recording, duration: float = 0.2) -> list[PushWindow]:
    return find_windows(recording, require_rig(recording), WindowOptions(duration=duration))


# --- mcube ------------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_runs_of_a_block_have_in_one_recording_the_windows_that_each_has_alone(
    measured_data: Path, blocks: dict[str, Split], tmp_path: Path
) -> None:
    runs = import_source("mcube", [measured_data / "mcube_preliminary"], tmp_path).written
    alone = {w.start: w.displacement for run in runs for w in windows_of(read_recording(run))}
    parts = [part for split in blocks.values() for part in (split.training, split.traced, split.later)]
    together = {w.start: w.displacement for part in parts for w in windows_of(part)}
    assert set(together) == set(alone) and len(alone) > 80
    for start, displacement in alone.items():
        np.testing.assert_allclose(together[start], displacement, atol=1e-9)


def test_runs_are_trained_on_traced_and_kept_in_order_of_time(blocks: dict[str, Split]) -> None:
    assert len(blocks) == 2
    for split in blocks.values():
        ends = [(part.slider.stamp[0], part.slider.stamp[-1]) for part in (split.training, split.traced, split.later)]
        assert np.all(np.diff(np.ravel(ends)) > 0)


# --- mlab -------------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_windows_of_a_log_add_up_to_the_measured_pushes(logs: dict[str, Split], table: PushTable) -> None:
    """A window of almost the whole push, so that few per cent of the measured displacement are outside it."""
    share = 5.3 / table.duration
    windows = windows_of(logs[WOOD].traced, 5.3)
    assert len(windows) == 40
    for row, window in enumerate(windows):
        expected = share[row] * table.outcomes[row]
        pose = [table.covariates[f"slider_{k}"][row] for k in ("x", "y", "heading")]
        np.testing.assert_allclose(window.displacement, expected, rtol=0.01, atol=2e-5)
        np.testing.assert_allclose(window.slider_start, pose, atol=1e-3)
        assert window.velocity == pytest.approx(table.inputs[row, 0], rel=1e-3)
        assert window.contact == pytest.approx(table.inputs[row, 1], abs=1e-3)
        assert window.angle == pytest.approx(table.inputs[row, 2], abs=0.01)


def test_logs_are_in_order_of_time_also_where_a_file_is_not(logs: dict[str, Split]) -> None:
    assert any(name.startswith(f"mlab {MIXED}") for name in logs)
    for split in logs.values():
        stamps = np.concatenate([part.slider.stamp for part in (split.training, split.traced, split.later)])
        assert np.all(np.diff(stamps) > 0)
