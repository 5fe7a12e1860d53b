# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""No command overwrites an existing output without --force, and none starts work before it has checked this."""

from __future__ import annotations

from pathlib import Path

import pytest

from push_predictor.cli import main
from push_predictor.commands.common.output import check_folder, check_output
from push_predictor.errors import RequestError

PUSH = ["--velocity", "0.02", "--contact", "0.1", "--angle", "0.3"]
SIMULATE = ["simulate", "--shape", "rect1", "--surface", "abs", "--pushes", "1", "--speed", "0.05"]
CALLS = [  # {old} exists; the inputs are absent or damaged, so that nothing is computed
    ["predict", "absent", *PUSH, "--json", "{old}"],
    ["info", "absent", "--json", "{old}"],
    ["check", "absent", "--json", "{old}"],
    ["evaluate", "absent", "absent", "--json", "{old}"],
    [*SIMULATE[:2], "blob", *SIMULATE[3:], "--out", "{old}.mcap"],
    [*SIMULATE[:2], "blob", *SIMULATE[3:], "--out", "{folder}"],
    ["train", "{data}", "--kind", "gp", "--out", "{old}"],
    ["train", "{data}", "--kind", "analytical", "--fit", "--out", "{folder}/new.pushmodel"],
    ["suggest", "absent", "--out", "{old}"],
    ["rig", "--square", "90", "--tip-radius", "0.005", "--surface", "abs", "--out", "{old}"],
    ["validate", "absent", "absent", "--windows", "{old}"],
    ["trace", "absent", "absent", "--report", "{old}"],
    ["trace", "absent", "absent", "--save-model", "{old}"],
    ["trace", "absent", "absent", "--json", "{old}"],
    ["report", "validation", "absent", "--recording", "absent", "--out", "{folder}"],
    ["report", "paper", "--data", "absent", "--out", "{folder}"],
    ["import", "mit-square", "absent", "--out", "{folder}", "--json", "{old}"],
]


def filled(call: list[str], folder: Path) -> list[str]:
    """The call with names of files that exist."""
    outputs = folder / "outputs"
    outputs.mkdir()
    for name in ("report.html", "paper.html", "new.ladder.json"):
        (outputs / name).write_text("earlier result")
    for name in ("old", "old.mcap"):
        (folder / name).write_text("earlier result")
    (folder / "data.csv").write_text("damaged")
    names = {"old": folder / "old", "folder": outputs, "data": folder / "data.csv"}
    return [word.format(**names) for word in call]


def contents(folder: Path) -> dict[Path, str]:
    return {path: path.read_text() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("call", CALLS, ids=" ".join)
def test_an_existing_output_is_refused_before_the_work(
    call: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = filled(call, tmp_path)
    before = contents(tmp_path)
    assert main(words) == 1
    (line,) = capsys.readouterr().err.splitlines()
    option, value = words[-2:]
    assert f"{option}: '{Path(value).parent if '--fit' in words else value}' is not accepted, give another " in line
    assert "or --force to overwrite " in line
    assert main([*words, "--force"]) == 1  # now the inputs are what is wrong
    assert "--force" not in capsys.readouterr().err
    assert contents(tmp_path) == before


def test_force_replaces_a_recording_and_no_other_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call = [*SIMULATE, "--travel", "0.01", "--out", str(tmp_path / "bag")]
    assert main(call) == 0
    first = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
    assert main([*call, "--seed", "1"]) == 1
    assert (tmp_path / "bag" / "bag_0.mcap").read_bytes() == first
    assert main([*call, "--seed", "1", "--force"]) == 0
    assert (tmp_path / "bag" / "bag_0.mcap").read_bytes() != first
    (tmp_path / "bag" / "thesis.tex").write_text("no bag has this")
    assert main([*call, "--force"]) == 1
    assert "exists and is not a bag" in capsys.readouterr().err
    assert (tmp_path / "bag" / "thesis.tex").exists()


def test_what_has_no_content_is_not_protected(tmp_path: Path) -> None:
    (tmp_path / "empty").touch()  # as mktemp makes it
    (tmp_path / "folder").mkdir()
    check_output("--json", tmp_path / "empty", force=False)
    check_output("--out", tmp_path / "folder", force=False, folder=True)
    check_output("--json", Path("/dev/null"), force=False)
    check_output("--json", tmp_path / "absent", force=False)
    check_folder("--out", tmp_path, ["empty", "absent"], force=False)


def test_a_link_to_a_result_is_protected_and_a_folder_is_no_file_even_with_force(tmp_path: Path) -> None:
    (tmp_path / "result").write_text("earlier")
    (tmp_path / "link").symlink_to(tmp_path / "result")
    with pytest.raises(RequestError, match=r"--json.*link.*--force to overwrite this file"):
        check_output("--json", tmp_path / "link", force=False)
    with pytest.raises(RequestError, match="--force to overwrite result in it"):
        check_folder("--out", tmp_path, ["absent", "result"], force=False)
    with pytest.raises(RequestError, match="this is a folder"):
        check_output("--json", tmp_path, force=True)
    with pytest.raises(RequestError, match="this is a file"):
        check_folder("--out", tmp_path / "result", force=True)
