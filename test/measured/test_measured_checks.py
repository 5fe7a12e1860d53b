# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The checks of data measured by others: sound recordings are not refused, and mistakes made in them are caught."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mistakes import MISTAKES

from push_predictor.recordings.checks.check import check_recording
from push_predictor.recordings.checks.units import check_table
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.load import known_rig
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import read_table

ALTERED = ("Al_block_metal_1", "St_block_metal_2")
CAUGHT = (
    "slider in mm",
    "pusher in mm",
    "heading in degrees",
    "stamps in ms",
    "w first",
    "wrench of the wrong sign",
    "wrench along other axes",
    "no orientation",
    "no wrench",
    "wrench in mN",
    "constant wrench",
    "wrench of another time",
    "wrench of random direction",
)  # by the right name, also with one long push; outline and clocks need eight


@pytest.fixture(scope="module")
def recordings(measured_data: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Recording]:
    """Every recording of mcube_preliminary and mit_raw, by name."""
    out = tmp_path_factory.mktemp("imported")
    sources = [("mcube", measured_data / "mcube_preliminary"), ("mit", measured_data / "mit_raw")]
    written = [path for kind, source in sources for path in import_source(kind, [source], out / kind).written]
    return {path.name: read_recording(path) for path in written}


@pytest.fixture(scope="module")
def tables(measured_data: Path, tmp_path_factory: pytest.TempPathFactory) -> list[tuple[PushTable, Rig | None]]:
    """The tables of mit_square and mlab, with their rigs."""
    out = tmp_path_factory.mktemp("tables")
    sources = [("mit-square", measured_data / "mit_square" / "pushes_3500.npz"), ("mlab", measured_data / "mlab")]
    written = [path for kind, source in sources for path in import_source(kind, [source], out / kind).written]
    return [(read_table(path), known_rig(path)) for path in written if path.suffix == ".csv"]


def test_sound_recordings_are_neither_refused_nor_warned_about(recordings: dict[str, Recording]) -> None:
    assert len(recordings) == 9
    for name, recording in recordings.items():
        found = check_recording(recording, require_rig(recording))
        assert {finding.name for finding in found} <= {"outline_unchecked"}, name


@pytest.mark.parametrize("name", [ALTERED[0], pytest.param(ALTERED[1], marks=pytest.mark.long)])
@pytest.mark.parametrize("mistake", CAUGHT)
def test_mistakes_are_caught(recordings: dict[str, Recording], name: str, mistake: str) -> None:
    alter, finding, severity = MISTAKES[mistake]
    wrong = alter(recordings[name])
    found = {each.name: each.severity for each in check_recording(wrong, require_rig(wrong))}
    assert found.get(finding) == severity


@pytest.mark.parametrize("name", [ALTERED[0], pytest.param(ALTERED[1], marks=pytest.mark.long)])
def test_exchanged_topics_are_refused(recordings: dict[str, Recording], name: str) -> None:
    """Of a tip with a constant heading it may be said that the quaternion is wrong."""
    wrong = MISTAKES["topics exchanged"][0](recordings[name])
    assert "refused" in {finding.severity for finding in check_recording(wrong, require_rig(wrong))}


def test_sound_tables_have_no_finding_and_wrong_units_are_refused(tables: list[tuple[PushTable, Rig | None]]) -> None:
    assert len(tables) > 10
    for table, rig in tables:
        assert check_table(table, rig) == check_table(table) == ()
        in_mm = replace(table, inputs=table.inputs * [1e3, 1.0, 1.0], outcomes=table.outcomes * [1e3, 1e3, 1.0])
        assert "refused" in {finding.severity for finding in check_table(in_mm)}
    degrees = replace(tables[0][0], outcomes=tables[0][0].outcomes * [1.0, 1.0, np.degrees(1.0)])
    assert [finding.name for finding in check_table(degrees)] == ["units_dtheta"]


def test_mirrored_tables_are_named(tables: list[tuple[PushTable, Rig | None]]) -> None:
    """Those with enough pushes outside the friction cone."""
    large = [(table, rig) for table, rig in tables if len(table) >= 50]
    assert len(large) >= 8
    for table, rig in large:
        wrong = replace(table, outcomes=table.outcomes * [1.0, -1.0, -1.0])
        assert [finding.name for finding in check_table(wrong, rig)] == ["table_mirrored"]
