# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The command `check`: its text, its JSON and its exit status."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from repository import REPOSITORY

from push_predictor.cli import main
from push_predictor.geometry.outline import Outline
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.rig import save_rig

BAG = str(REPOSITORY / "bags" / "hexagon_delrin")
SOUND = str(REPOSITORY / "bags" / "square_abs_test")


def wrong_rig(folder: Path, size: float) -> str:
    rig = read_recording(Path(BAG)).rig
    assert rig is not None
    save_rig(replace(rig, outline=Outline(size * rig.outline.vertices)), folder / "wrong.rig.yaml")
    return str(folder / "wrong.rig.yaml")


def test_a_sound_recording_has_no_findings(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", SOUND, "--strict"]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"{SOUND}: no findings. The data contain 120 pushes (603 windows) on 4 of 4 sides, at ")


def test_few_pushes_are_a_note_with_what_to_record_next(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", BAG, "--strict"]) == 0
    assert "note     few_pushes" in (text := capsys.readouterr().out) and "at least 20 more pushes" in text


def test_the_json_contains_the_coverage(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", BAG, "--json", "-"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["sound"], "notes are no mistakes"
    coverage = content["about"][BAG]["coverage"]
    assert (coverage["pushes"], coverage["windows"]) == (10, sum(coverage["windows_by_side"]))


def test_a_warning_fails_only_with_strict(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = wrong_rig(tmp_path, 1.04)
    assert main(["check", BAG, "--rig", rig, "--json", "-"]) == 0
    assert not json.loads(capsys.readouterr().out)["sound"]
    assert main(["check", BAG, "--rig", rig, "--strict"]) == 1
    printed = capsys.readouterr()
    assert "warning  outline_size" in printed.out
    assert printed.err.splitlines()[-1] == f"push_predictor check: {BAG}: outline_size"  # after progress


def test_a_refusal_fails_and_is_in_the_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", BAG, "--rig", wrong_rig(tmp_path, 1e3), "--json", "-"]) == 1
    content = json.loads(capsys.readouterr().out)
    (finding,) = content["data"][BAG]
    assert not content["sound"]
    assert (finding["name"], finding["severity"], finding["values"]["reach"]["unit"]) == ("units_rig", "refused", "m")


def test_the_page_is_written_and_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "check.html"
    assert main(["check", BAG, "--page", str(page)]) == 0
    assert capsys.readouterr().out.endswith(f"page: {page}\n") and "No mistake was found." in page.read_text()
    assert main(["check", BAG, "--page", str(tmp_path)]) == 1
    assert "--page" in capsys.readouterr().err
