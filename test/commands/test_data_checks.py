# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""`check`, and the checks inside other commands: each usual mistake is refused or warned about, once."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lab_bags import short_recording
from mistakes import MISTAKES
from repository import REPOSITORY

from push_predictor.cli import main
from push_predictor.geometry.outline import Outline
from push_predictor.recordings.load import load_data
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.rig import save_rig
from push_predictor.recordings.table_file import write_table
from push_predictor.recordings.write import write_recording

SMALL = REPOSITORY / "bags" / "hexagon_delrin"
REFUSED, WARNED = "both in mm", "wrench of the wrong sign"  # test_checks makes every mistake
COMMANDS: dict[str, Callable[[Path, Path, str], list[str | Path]]] = {
    "train": lambda model, out, data: ["train", data, "--kind", "analytical", "--force", "--out", out / "m.pushmodel"],
    "evaluate": lambda model, out, data: ["evaluate", model, data],
    "validate": lambda model, out, data: ["validate", model, data],
    "trace": lambda model, out, data: ["trace", model, data],
    "suggest": lambda model, out, data: ["suggest", model, "--count", "1", "--out", out / "next.csv", "--matter", data],
    "report": lambda model, out, data: ["report", "validation", model, "--out", out, "--recording", data],
}


def lines_of(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """The lines on stderr, without those of progress."""
    return [line for line in capsys.readouterr().err.splitlines() if not re.fullmatch(r"[a-z ]+: \d+ s(, .*)?", line)]


@pytest.fixture(scope="module")
def altered(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Recordings with a mistake, by the mistake's name."""
    folder, sound = tmp_path_factory.mktemp("mistakes"), read_recording(SMALL)
    paths = {name: folder / name.replace(" ", "_") for name in (REFUSED, WARNED)}
    for name, path in paths.items():
        write_recording(path, MISTAKES[name][0](sound))
    return paths


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An analytical model of the hexagon."""
    path = tmp_path_factory.mktemp("model") / "hexagon.pushmodel"
    assert main(["train", str(SMALL), "--kind", "analytical", "--out", str(path)]) == 0
    return path


def train(tmp_path: Path, *words: str | Path, kind: str = "analytical") -> int:
    out = tmp_path / "trained.pushmodel"
    out.unlink(missing_ok=True)
    status = main(["train", *map(str, words), "--kind", kind, "--out", str(out)])
    assert out.exists() == (status == 0)
    return status


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_that_reads_data_checks_them(
    command: str,
    altered: dict[str, Path],
    model: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Refusals end it; warnings are shown once, and end it with --strict, which `suggest` does not have."""
    monkeypatch.setattr("push_predictor.design.batch.CANDIDATES", 16)

    def run(name: str, *words: str) -> tuple[int, list[str]]:
        status = main([*map(str, COMMANDS[command](model, tmp_path, str(altered[name]))), *words])
        return status, lines_of(capsys)

    status, (line,) = run(REFUSED)
    assert status == 1 and line.startswith(f"push_predictor {command}: {altered[REFUSED]}: ")
    assert "its positions are probably in mm" in line
    if command != "report":  # whose pictures take seconds
        warned = [line for line in run(WARNED)[1] if "change the sign" in line]
        assert len(warned) == 1 and warned[0].startswith(f"warning: {altered[WARNED]}: ")
    if command != "suggest":
        status, (line,) = run(WARNED, "--strict")
        assert status == 1 and line.startswith(f"push_predictor {command}: {altered[WARNED]}: ")
        assert "change the sign" in line


def test_a_table_in_millimetres_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table, rig = load_data([SMALL]), read_recording(SMALL).rig
    assert rig is not None
    write_table(tmp_path / "wrong.csv", replace(table, inputs=table.inputs * [1e3, 1.0, 1.0]))
    save_rig(rig, tmp_path / "wrong.rig.yaml")
    assert train(tmp_path, tmp_path / "wrong.csv") == 1
    assert "velocity reaches" in (text := capsys.readouterr().err) and "mm/s" in text


def test_a_learnt_model_wants_more_than_a_few_pushes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An analytical model does not, and the pushes of all recordings count together."""
    table, rig = load_data([SMALL]), read_recording(SMALL).rig
    assert rig is not None
    for name, pushes in (("first", table.pushes[:5]), ("second", table.pushes[5:])):
        write_table(tmp_path / f"{name}.csv", table.take(np.isin(table.push_id, pushes)))
        save_rig(rig, tmp_path / f"{name}.rig.yaml")
    first, second = tmp_path / "first.csv", tmp_path / "second.csv"
    assert train(tmp_path, first, "--mean", "zero", kind="gp") == 0
    assert f"warning: {first}: The data contain 5 pushes" in capsys.readouterr().err
    assert train(tmp_path, first, second, "--mean", "zero", "--strict", kind="gp") == 0
    assert train(tmp_path, first, "--strict") == 0


MEANING = "The results are valid only for the part of the domain that was pushed."


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of the first seconds, with few pushes."""
    path = tmp_path_factory.mktemp("short") / "few"
    write_recording(path, short_recording(8.0))
    return path


@pytest.mark.parametrize("command", ["validate", "evaluate", "trace"])
def test_few_pushes_limit_the_results_of_the_commands_that_judge(
    few: Path, model: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    """Once, as a warning; with --strict as an error."""
    words = [command, str(model), str(few)]
    assert main(words) == (1 if command == "trace" else 0)  # which needs more pushes
    (line,) = [line for line in lines_of(capsys) if MEANING in line]
    assert re.match(rf"warning: {few}: The data contain \d push(es)? only\. ", line)
    assert main([*words, "--strict"]) == 1
    (line,) = lines_of(capsys)
    assert line.startswith(f"push_predictor {command}: {few}: The data contain") and line.endswith(MEANING)


# --- check command ----------------------------------------------------------------------------------------------------


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
