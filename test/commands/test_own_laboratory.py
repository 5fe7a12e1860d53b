# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A laboratory's own recording without the names of its topics; with them, test_blocks runs the how-to's commands."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("rosbags")
from lab_bags import laboratory, short_recording, write_db3

from push_predictor.cli import main


def test_a_command_that_is_not_given_the_topics_names_those_of_the_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_db3(laboratory(short_recording()), tmp_path / "monday")
    assert main(["info", str(tmp_path / "monday")]) == 1
    assert "/vicon/block/block (geometry_msgs/msg/TransformStamped)" in capsys.readouterr().err
