# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""From a laboratory's own recording to a validated model, by the commands that README shows."""

from __future__ import annotations

import re
import shlex
from dataclasses import replace
from pathlib import Path

import pytest
from repository import REPOSITORY

pytest.importorskip("rosbags")
from lab_bags import laboratory, short_recording, write_db3

from push_predictor.cli import main
from push_predictor.recordings.streams import Recording, taken

pytestmark = pytest.mark.slow


def commands() -> list[list[str]]:
    """The commands of README for a recording of one's own."""
    text = (REPOSITORY / "README.md").read_text()
    block = text[text.index("## Use a recording of your own") :]
    return [shlex.split(line)[1:] for line in re.findall(r"^    (push_predictor .*)$", block, re.MULTILINE)[:4]]


def thinned(recording: Recording) -> Recording:
    """Every second sample: 50 Hz."""
    slider, pusher, wrench = (
        taken(stream, slice(None, None, 2)) for stream in (recording.slider, recording.pusher, recording.wrench)
    )
    return replace(recording, slider=slider, pusher=pusher, wrench=wrench)


def test_the_commands_of_the_readme_validate_a_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monday, tuesday = thinned(short_recording(52.0)), thinned(short_recording(52.0, after=75.0))
    write_db3(laboratory(monday), tmp_path / "monday")
    laboratory(tuesday).mcap(tmp_path / "tuesday")
    monkeypatch.chdir(tmp_path)
    rig, check, train, validate = commands()
    info = ["info", "monday"]

    assert main(rig) == 0
    assert main(info) == 1  # the topics have other names; the error shows them
    assert "/vicon/block/block (geometry_msgs/msg/TransformStamped)" in capsys.readouterr().err
    capsys.readouterr()
    assert main(check) == 0
    monday_line, tuesday_line = capsys.readouterr().out.splitlines()
    assert re.match(r"monday: no findings\. The data contain \d+ pushes", monday_line)
    assert re.match(r"tuesday: no findings\. The data contain \d+ pushes", tuesday_line)
    assert main(info) == 0
    assert "slider: 2598 samples" in capsys.readouterr().out
    assert main([*train, "--n-train", "60", "--mean", "zero"]) == 0  # all windows and a mean take seconds more
    assert (tmp_path / "monday.pushmodel").is_file()
    capsys.readouterr()
    assert main(validate) == 0
    # Of so few pushes nothing is learnt that mechanics would not know better.
    assert capsys.readouterr().out.startswith("The model predicts worse than textbook physics: ")
