# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Which recordings push_replay checks, and with which topics; without a node process."""

from __future__ import annotations

from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any

import pytest
from replay_bags import POSE, START, WRENCH, push_messages, write_bag

from push_predictor.nodes import push_replay
from push_predictor.nodes.push_replay import PushReplay
from push_predictor.online.check_process import CheckProcess
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.recordings.topics import Topics, save_topics

LAB = {"/vicon/block/block": "geometry_msgs/msg/TransformStamped", "/tf": "tf2_msgs/msg/TFMessage"}
NAMED = Topics("/vicon/block/block", "/tf:tool0", "/netft", wrench_frame="tip")


class Bench:
    """In place of a node: its options and its log. started: what the process was asked to check."""

    def __init__(self, recording: Path, topics: Topics, monkeypatch: pytest.MonkeyPatch) -> None:
        self.logged: list[str] = []
        self.started: list[tuple[Any, ...]] = []
        monkeypatch.setattr(CheckProcess, "start", lambda _, *what: self.started.append(what))
        self._recording, self._given_topics = recording, topics
        self._given_rig = None
        self._rig_warning, self._checks = "", CheckProcess()

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=self.logged.append)

    def check(self, rig_warning: str = "") -> str:
        """Begin the check as the node does; returns its result so far."""
        self._streams = PushReplay._stream_topics(self)  # type: ignore[arg-type]  # a stand-in for the node
        self._rig_warning = rig_warning
        bag = SimpleNamespace(path=self._recording, topics=LAB)
        PushReplay._check(self, bag)  # type: ignore[arg-type]  # stand-ins for the node and the bag
        return self._checks.result


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    (tmp_path / "lab.mcap").write_bytes(b"")
    return tmp_path / "lab.mcap"


def test_saved_topics_are_found_and_given_ones_win(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_topics(bag, NAMED)
    bench = Bench(bag, Topics(wrench="/ft"), monkeypatch)
    bench.check()
    assert bench.started == [(bag, None, Topics(wrench="/ft"))], "the process reads the saved ones itself"
    assert bench._streams == Topics(NAMED.slider, NAMED.pusher, "/ft", wrench_frame="tip") and bench.logged == []


def test_without_names_a_bag_of_other_topics_is_not_checked_and_nobody_is_warned(
    bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(bag, Topics(), monkeypatch)
    assert bench.check() == "not checked: no topic slider/pose or pusher/pose"
    assert bench.started == [] and bench.logged == []


def test_a_name_that_the_bag_lacks_is_warned_about(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(bag, Topics("/vicon/block/blok", "/tf:tool0"), monkeypatch)
    assert bench.check() == "not checked: no topic /vicon/block/blok"
    assert bench.started == [] and bench.logged == ["the recording is not checked: no topic /vicon/block/blok"]


def test_a_recording_without_a_rig_is_not_checked(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert Bench(bag, NAMED, monkeypatch).check("no push_rig record") == "not checked: no rig"


def test_damaged_saved_topics_do_not_end_the_replay(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag.with_name("lab.recording.yaml").write_text("slider: /a")
    bench = Bench(bag, NAMED, monkeypatch)
    bench.check()
    assert len(bench.started) == 1 and len(bench.logged) == 1 and "key 'slider' is not accepted" in bench.logged[0]


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
    lists, expressions = (
        ("topics_to_filter", "exclude_topics_to_filter"),
        ("regex_to_filter", "exclude_regex_to_filter"),
    )
    values = {**{name: list[str]() for name in lists}, **dict.fromkeys(expressions, "")}
    node: Any = SimpleNamespace(
        _streams=Topics(),
        _values={f"play.{name}": value for name, value in values.items()},
        _ending=Event(),
        get_logger=bench.get_logger,
    )
    PushReplay._open_topics(node, open_bag(write_bag(tmp_path / "a.mcap", untyped + blob)))
    assert played == [{"/pusher/pose": POSE, "/pusher/wrench": WRENCH, "/slider/pose": POSE}]
    assert "/blob was recorded without a schema and is not read" in bench.logged
    PushReplay._open_topics(node, open_bag(write_bag(tmp_path / "b.mcap", blob + [("/slider/pose", *blob[0][1:])])))
    assert played[1] == {} and "slider_topic 'slider/pose'" in bench.logged[-1]
