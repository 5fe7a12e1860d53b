# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Which recordings push_replay checks, and with which topics; without a node process."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any

import pytest
from replay_bags import POSE, START, WRENCH, push_messages, write_bag

from push_predictor.nodes import push_replay
from push_predictor.nodes.parameter_tables import PUSH_REPLAY
from push_predictor.nodes.push_replay import PushReplay
from push_predictor.online.check_process import PENDING, CheckProcess
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.recordings.topics import Topics

LAB = {"/vicon/block/block": "geometry_msgs/msg/TransformStamped", "/tf": "tf2_msgs/msg/TFMessage"}
NAMED = Topics("/vicon/block/block", "/tf:tool0", "/netft", wrench_frame="tip")


class Bench:
    """In place of a node: its options and its log. started: what the process was asked to check."""

    def __init__(self, recording: Path, topics: Topics, monkeypatch: pytest.MonkeyPatch, rig_warning: str = "") -> None:
        self.logged: list[str] = []
        self.started: list[tuple[Any, ...]] = []
        monkeypatch.setattr(CheckProcess, "start", lambda _, *what: self.started.append(what))
        self._recording, self._given_topics, self._given_rig = recording, topics, None
        self._rig_warning, self._checks = rig_warning, CheckProcess()

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=self.logged.append)


NO_BLOCK = "not checked: no topic /vicon/block/blok"


@pytest.mark.parametrize(
    ("saved", "given", "rig_warning", "result", "logged"),
    [
        ("", Topics(), "", "not checked: no topic slider/pose or pusher/pose", []),  # nobody is warned
        ("", replace(NAMED, slider="/vicon/block/blok"), "", NO_BLOCK, [f"the recording is {NO_BLOCK}"]),
        ("", NAMED, "no push_rig record", "not checked: no rig", []),
        ("", NAMED, "", PENDING, []),
        ("slider_topic: /vicon/block/block\npusher_topic: /tf:tool0\n", Topics(wrench="/ft"), "", PENDING, []),
        ("slider: /a", NAMED, "", PENDING, ["key 'slider' is not accepted"]),  # damaged
    ],
)
def test_a_recording_with_a_rig_and_poses_is_checked(
    saved: str, given: Topics, rig_warning: str, result: str, logged: list[str], tmp_path: Path, monkeypatch: Any
) -> None:
    (bag := tmp_path / "lab.mcap").touch()
    if saved:
        bag.with_name("lab.recording.yaml").write_text(saved)
    node: Any = Bench(bag, given, monkeypatch, rig_warning)
    node._streams = PushReplay._stream_topics(node)
    PushReplay._check(node, SimpleNamespace(path=bag, topics=LAB))  # type: ignore[arg-type]  # in place of a bag
    assert node._checks.result == result
    assert node.started == ([(bag, None, given)] if result == PENDING else []), "the process reads saved topics itself"
    assert len(node.logged) == len(logged) and all(words in node.logged[0] for words in logged)
    assert node._streams.wrench == given.wrench


def test_topics_without_a_schema_are_played_as_the_types_that_they_fit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    played: list[dict[str, str]] = []

    def made(node: object, topics: dict[str, str], *_: object) -> object:
        played.append(topics)
        return SimpleNamespace(skipped={})

    monkeypatch.setattr(push_replay, "ReplayTopics", made)
    untyped = [(topic, "", time, data) for topic, _, time, data in push_messages(0.1)]
    blob = [("/blob", "", START, b"\0\1\0\0\1\2\3")]
    bench = Bench(tmp_path, Topics(), monkeypatch)
    values = {param.name: param.default for param in PUSH_REPLAY} | {"play.topics_to_filter": []}
    values["play.exclude_topics_to_filter"] = []
    node: Any = SimpleNamespace(_streams=Topics(), _values=values, _ending=Event(), get_logger=bench.get_logger)
    PushReplay._open_topics(node, open_bag(write_bag(tmp_path / "a.mcap", untyped + blob)))
    assert played == [{"/pusher/pose": POSE, "/pusher/wrench": WRENCH, "/slider/pose": POSE}]
    assert "/blob was recorded without a schema and is not read" in bench.logged
    PushReplay._open_topics(node, open_bag(write_bag(tmp_path / "b.mcap", blob + [("/slider/pose", *blob[0][1:])])))
    assert played[1] == {} and "slider_topic 'slider/pose'" in bench.logged[-1]
