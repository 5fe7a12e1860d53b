# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A bag that is read, recorded again and validated gives the same windows: every type, with every option of frames.

The validator's subscriptions are given the messages that a middleware would have received.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags")
pytest.importorskip("rclpy")
from every_stream import KINDS, OWN, WRENCHES, in_order, laboratory, rig, topics_in, topics_of
from lab_bags import Message
from rclpy.logging import get_logger

from push_predictor.nodes.polling import Taken
from push_predictor.nodes.validator import live_streams, scalar_topics
from push_predictor.nodes.validator.sensor_subscriber import SensorSubscriber
from push_predictor.online import live_recording
from push_predictor.online.live_recording import LiveRecording
from push_predictor.recordings.bag.metadata import TopicInfo
from push_predictor.recordings.bag.writer import BagWriter
from push_predictor.recordings.load import load_data
from push_predictor.recordings.rig import RECORD_NAME
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.windows.finder import WindowFinder
from push_predictor.recordings.windows.push_window import PushWindow, windows_to_table

pytestmark = pytest.mark.ros

PORTION = 150  # messages
KINDS_GIVEN = [topics_of(kind, kind, number % 2 == 1, "tip") for number, kind in enumerate(KINDS)]
FORCES_GIVEN = [topics_of(force=force, axes="sensor") for force in [*WRENCHES, "none"]]
FRAMES_GIVEN = [
    replace(topics_of(slider, pusher, world, axes, force, up, stamp), wrench_bias=bias)
    for up, stamp in (("", "log"), ("y", ""))
    for force, bias in (("sum", "none"), ("biased", "free_motion"))
    for slider, pusher in (("field", "tf"), ("named", "transform"))
    for axes in ("world", "tip", "sensor")
    for world in (False, True)
]
SOME = [*KINDS_GIVEN, *FORCES_GIVEN, *FRAMES_GIVEN[::5]]
GIVEN = [pytest.param(topics, marks=[] if topics in SOME else pytest.mark.long, id=" ".join(
    str(value) for name, value in vars(topics).items() if value and name != "covariates"
)) for topics in [*KINDS_GIVEN, *FORCES_GIVEN, *FRAMES_GIVEN]]  # fmt: skip


@pytest.fixture(autouse=True)
def own_types(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The laboratory's types, as if installed."""
    for name, text in OWN.items():
        file = tmp_path / "prefix" / "share" / f"{name}.msg"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    before = os.environ.get("AMENT_PREFIX_PATH", sys.prefix)
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'prefix'}{os.pathsep}{before}")


@pytest.mark.parametrize("topics", GIVEN)
def test_reading_recording_and_validating_give_the_same_table(
    topics: Topics, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    messages = in_order(topics, [], topics.up[:1])
    offline = load_data([written(tmp_path / "lab.mcap", topics, messages)], topics=topics)
    assert len(offline) > 2 and {f"topic:{name}" for name in topics.covariates} <= offline.covariates.keys()
    assert topics.wrench == "none" or "normal_force" in offline.covariates
    copy, found_meanwhile = recorded(tmp_path / "copy", topics, messages, monkeypatch)
    assert_same(load_data([copy]), offline)
    assert_same(found_meanwhile, without_scalars(offline))
    assert_same(validated(topics, messages, monkeypatch), offline)


def assert_same(found: PushTable, wanted: PushTable) -> None:
    assert found.push_id.tolist() == wanted.push_id.tolist()
    assert found.covariates.keys() == wanted.covariates.keys()
    columns = [(getattr(found, name), getattr(wanted, name)) for name in ("inputs", "duration", "outcomes")]
    for one, other in chain(columns, ((found.covariates[name], wanted.covariates[name]) for name in wanted.covariates)):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-9)


def without_scalars(table: PushTable) -> PushTable:
    """The table as the recorder sees it: it records scalars only."""
    kept = {name: column for name, column in table.covariates.items() if not name.startswith("topic:")}
    return replace(table, covariates=kept)


def written(path: Path, topics: Topics, messages: Sequence[Message]) -> Path:
    """A bag with the messages of these topics."""
    lab = laboratory(topics.up[:1])
    with BagWriter(path) as writer:
        writer.add_metadata(RECORD_NAME, rig().to_record())
        for name in ("/tf_static", *topics_in(topics)):
            if kind := lab.kinds.get(name):
                writer.add_topic(name, kind, lab.definition(kind))
        for sent, name, data in messages:
            writer.write(name, sent, data)
    return path


def recorded(
    path: Path, topics: Topics, messages: Sequence[Message], monkeypatch: pytest.MonkeyPatch
) -> tuple[Path, PushTable]:
    """The bag that the recorder writes, and the windows that it finds meanwhile."""
    finders: list[Finder] = []

    class Finder(WindowFinder):
        def __init__(self, *given: Any) -> None:
            super().__init__(*given)
            self.found: list[PushWindow] = []
            finders.append(self)

        def take_ready(self) -> list[PushWindow]:
            self.found += (windows := super().take_ready())
            return windows

        def finish(self) -> list[PushWindow]:
            self.found += (windows := super().finish())
            return windows

    monkeypatch.setattr(live_recording, "WindowFinder", Finder)
    recording, lab = LiveRecording(path, topics, 0.0), laboratory(topics.up[:1])
    recording.set_rig(rig())
    for wanted in recording.wanted:
        if kind := lab.kinds.get(wanted.name):
            recording.add_topic(TopicInfo(wanted.name, kind, 0))
    recorded_names, begin = {wanted.name for wanted in recording.wanted}, messages[0][0]
    for first in range(0, len(messages), PORTION):
        for sent, name, data in messages[first : first + PORTION]:
            if name in recorded_names:
                recording.write(name, sent, data)
        recording.work(1e-9 * (messages[first][0] - begin))
    progress = recording.close(10.0)
    (finder,) = finders
    assert progress.windows == len(finder.found)
    return recording.path, windows_to_table(finder.found)


def validated(topics: Topics, messages: Sequence[Message], monkeypatch: pytest.MonkeyPatch) -> PushTable:
    """The windows that the validator finds."""
    subscriptions: list[Given] = []

    class Given:
        """A FollowingSubscription that has what is put into it."""

        problem, heard, lost, reliability = "", 0.0, 0, None

        def __init__(self, node: Any, topic: str, unfit: Callable[[str], str], *_: object, **__: object) -> None:
            self.name = node.resolve_topic_name(topic)
            self.kind = laboratory(topics.up[:1]).kinds.get(self.name, "")
            self.kinds = self.offered = [self.kind] if self.kind else []
            self.arrived: list[Taken] = []
            self.unfit = unfit
            subscriptions.append(self)

        def look(self) -> None:
            """Nothing changes."""
            assert not self.kind or self.kind.startswith("tf2_msgs") or not self.unfit(self.kind)

        def taken(self) -> Iterator[Taken]:
            while self.arrived:
                yield self.arrived.pop(0)

    for module in (live_streams, scalar_topics):
        monkeypatch.setattr(module, "FollowingSubscription", Given)
    sensors, finder = SensorSubscriber(Named(), topics), WindowFinder(rig())
    sensors.decoder.begin(rig())
    windows: list[PushWindow] = []
    try:
        for first in range(0, len(messages), PORTION):
            for sent, name, data in messages[first : first + PORTION]:
                for subscription in subscriptions:
                    if subscription.name == name:
                        subscription.arrived.append(Taken(data, 0, sent, sent))
            sensors.drain()
            samples = sensors.take()
            for scalar, stream in samples.scalars.items():
                finder.add_scalar(scalar, stream)
            finder.add_wrench(samples.wrench)
            finder.add_pusher(samples.pusher)
            finder.add_slider(samples.slider)
            windows += finder.take_ready()
        for scalar, stream in sensors.last_scalars().items():
            finder.add_scalar(scalar, stream)
    finally:
        sensors.close()
    return windows_to_table([*windows, *finder.finish()])


class Named:
    """The part of a node that a subscriber of given messages needs."""

    def resolve_topic_name(self, topic: str) -> str:
        return f"/{topic.strip('/')}"

    def get_logger(self) -> Any:
        return get_logger("three ways")
