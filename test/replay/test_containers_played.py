# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Every container that is read is also played: all messages, each at its time, by the player on a fake clock."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")
from lab_bags import Lab, pose_rows, short_recording, write_db3, write_ros1
from test_replay_player import Stage

from push_predictor.recordings.bag.reader import open_bag
from push_predictor.replay.player import SECOND
from push_predictor.replay.source import BagSource

POSE, WRENCH = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped"
Write = Callable[[Lab, Path], Path]


@pytest.fixture(scope="module")
def lab() -> Lab:
    """Two seconds of the usual topics."""
    recording, made = short_recording(2.0), Lab()
    assert recording.wrench is not None
    made.pose("/slider/pose", POSE, recording.slider, "pose")
    made.pose("/pusher/pose", POSE, recording.pusher, "pose")
    made.wrench("/pusher/wrench", recording.wrench, WRENCH, "wrench")
    return made


def write_csv(lab: Lab, path: Path) -> Path:
    """The same streams as CSV files."""
    recording = short_recording(2.0)
    assert recording.wrench is not None
    path.mkdir()
    fx, fy, torque = recording.wrench.fx, recording.wrench.fy, recording.wrench.torque
    none = np.zeros(len(fx))
    poses, header = {"slider": recording.slider, "pusher": recording.pusher}, "time,x,y,z,qx,qy,qz,qw"
    columns = {name: (header, stream.stamp, pose_rows(stream)) for name, stream in poses.items()}
    force = np.column_stack([fx, fy, none, none, none, torque])
    columns["wrench"] = ("time,fx,fy,fz,tx,ty,tz", recording.wrench.stamp, force)
    for name, (head, stamps, values) in columns.items():
        pairs = zip(stamps.tolist(), values.tolist(), strict=True)
        lines = [f"{t // 10**9}.{t % 10**9:09d},{','.join(map(repr, row))}" for t, row in pairs]
        (path / f"{name}.csv").write_text("\n".join([head, *lines, ""]))
    return path


def write_bag_file(lab: Lab, path: Path) -> Path:
    return write_ros1(lab, path.with_suffix(".bag"))


@pytest.mark.parametrize("write", [Lab.mcap, write_db3, write_bag_file, write_csv])
def test_every_message_of_a_recording_is_played_at_its_time(lab: Lab, tmp_path: Path, write: Write) -> None:
    bag = open_bag(write(lab, tmp_path / "lab"))
    source = BagSource(bag, tuple(bag.topics))
    stage = Stage([], source=source, rate=2.0, window=1000)
    stage.run()
    played = stage.log
    assert Counter(m.topic for _, m in played) == Counter(topic for _, topic, _ in lab.messages)
    assert stage.player.lateness.maximum <= 1 and stage.player.failed == 0 and source.damage == []
    times = [m.log_time for _, m in played]
    assert times == sorted(times)
    assert [wall for wall, _ in played] == pytest.approx([(t - source.start) / 2.0 / SECOND for t in times], abs=1e-6)
    assert {m.type for _, m in played} == {POSE, WRENCH}
