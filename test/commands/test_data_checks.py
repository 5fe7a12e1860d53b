# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The checks inside train, trace and validate: each usual mistake of a recording is refused or warned about, once."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lab_bags import short_recording
from mistakes import MISTAKES
from repository import REPOSITORY

from push_predictor.cli import main
from push_predictor.recordings.load import load_data
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.rig import save_rig
from push_predictor.recordings.table_file import write_table
from push_predictor.recordings.write import write_recording

SOUND = REPOSITORY / "bags" / "circle_pu"
SMALL = REPOSITORY / "bags" / "hexagon_delrin"
REFUSED = ("both in mm", "no orientation")  # test_checks makes every mistake; these are of each kind
WARNED = ("turned", "wrench of the wrong sign")


def lines_of(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """The lines on stderr, without those of progress."""
    return [line for line in capsys.readouterr().err.splitlines() if not re.fullmatch(r"[a-z ]+: \d+ s(, .*)?", line)]


@pytest.fixture(scope="module")
def altered(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Recordings with a mistake, by the mistake's name."""
    folder, sound = tmp_path_factory.mktemp("mistakes"), read_recording(SMALL)
    paths = {name: folder / name.replace(" ", "_") for name in (*REFUSED, *WARNED)}
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


@pytest.mark.parametrize("name", REFUSED)
def test_train_refuses(altered: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    assert train(tmp_path, altered[name]) == 1
    (line,) = lines_of(capsys)
    assert line.startswith(f"push_predictor train: {altered[name]}: ")


@pytest.mark.parametrize("name", WARNED)
def test_train_warns_once(
    altered: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    train(tmp_path, altered[name])  # which may also find no push
    assert len([line for line in lines_of(capsys) if line.startswith(f"warning: {altered[name]}: ")]) == 1


def test_train_fails_with_strict_and_states_the_warning(
    altered: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert train(tmp_path, altered["turned"], "--strict") == 1
    (line,) = lines_of(capsys)
    assert line.startswith(f"push_predictor train: {altered['turned']}: The slider is turned by -4.0 degrees")


def test_a_sound_recording_trains_with_strict_and_without_a_word(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert train(tmp_path, SOUND, "--strict") == 0
    assert lines_of(capsys) == []


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


@pytest.mark.parametrize("command", ["validate", "trace"])
def test_the_other_commands_check_as_train_does(
    altered: dict[str, Path], model: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    def run(name: str, *words: str) -> list[str]:
        path = str(altered[name])
        main(["validate", str(model), path, *words] if command == "validate" else ["trace", str(model), path])
        return lines_of(capsys)

    assert any("its positions are probably in mm" in line for line in run("both in mm"))
    assert any(line.startswith("warning:") and "change the sign" in line for line in run("wrench of the wrong sign"))


def test_validate_and_trace_fail_with_strict(
    altered: dict[str, Path], model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = str(altered["wrench of the wrong sign"])
    assert main(["validate", str(model), wrong, "--strict"]) == 1
    assert main(["trace", str(model), wrong, "--strict"]) == 1
    lines = lines_of(capsys)
    assert [line.split(":")[0] for line in lines] == ["push_predictor validate", "push_predictor trace"]


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


def test_evaluate_and_suggest_check_as_train_does(
    altered: dict[str, Path],
    model: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("push_predictor.design.batch.CANDIDATES", 16)
    suggest = ["suggest", str(model), "--count", "1", "--out", str(tmp_path / "next.csv"), "--matter"]
    for words in (["evaluate", str(model)], suggest):
        assert main([*words, str(altered["both in mm"])]) == 1
        assert "its positions are probably in mm" in lines_of(capsys)[0]
        main([*words, str(altered["wrench of the wrong sign"])])  # suggest: an analytical model has nothing to learn
        assert any("change the sign" in line for line in lines_of(capsys))


def test_a_report_checks_the_recording(
    altered: dict[str, Path], model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["report", "validation", str(model), "--out", str(tmp_path), "--recording"]
    assert main([*words, str(altered["both in mm"])]) == 1
    assert "its positions are probably in mm" in lines_of(capsys)[0]
    assert main([*words, str(altered["wrench of the wrong sign"]), "--strict"]) == 1
    assert "change the sign" in lines_of(capsys)[0]
