# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Measured pushes as recordings to replay: nothing measured is lost or changed, and nothing hidden is given away."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from examples import measured_recordings
from examples.measured_recordings import Split, joined, mcube_splits, mlab_splits
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import read_table
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions

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


def test_joined_recordings_keep_all_samples_in_order(recording: Recording) -> None:
    both = joined([recording, recording], "both")
    assert both.name == "both" and both.rig is recording.rig
    assert both.wrench is not None and recording.wrench is not None
    np.testing.assert_array_equal(both.slider.x, np.tile(recording.slider.x, 2))
    np.testing.assert_array_equal(both.pusher.stamp, np.tile(recording.pusher.stamp, 2))
    np.testing.assert_array_equal(both.wrench.fx, np.tile(recording.wrench.fx, 2))


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


def test_share_of_traced_pushes_moves_the_cut_and_loses_no_push(measured_data: Path, logs: dict[str, Split]) -> None:
    fewer = next(split for split in mlab_splits(measured_data, 0.6) if split.name == WOOD)
    whole = np.concatenate([logs[WOOD].traced.slider.stamp, logs[WOOD].later.slider.stamp])
    np.testing.assert_array_equal(np.concatenate([fewer.traced.slider.stamp, fewer.later.slider.stamp]), whole)
    assert len(fewer.later.slider) / len(whole) == pytest.approx(0.4, abs=0.01)
