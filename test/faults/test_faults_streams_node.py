# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Every fault of the streams, one after the other, sent to push_validator over DDS in simulated time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from replay_bags import stamped
from ros_harness import free_domain, ros_context, wait_until
from rosgraph_msgs.msg import Clock
from synthetic import START, Push, rows, square_pushes, square_rig, translating_push, wrench_rows
from validator_bench import Status, hosting_validator

from msg_adapters import ns_to_stamp
from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import train_model
from push_predictor.online.stream_health import LAGS, Samples, StreamSync
from push_predictor.recordings.rig import save_rig
from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import read_table
from push_predictor.recordings.windows.finder import WindowFinder
from push_predictor.recordings.windows.push_window import windows_to_table

SECOND, DAY = 10**9, 86_400 * 10**9
TOPICS = {"slider": "slider/pose", "pusher": "pusher/pose", "wrench": "pusher/wrench"}
PORTION = 10  # samples


def clean(start: float) -> Recording:
    """A push of one second, `start` s after the beginning."""
    recording = translating_push(Push(0.5, 1.7))
    assert recording.wrench is not None
    streams = {name: getattr(recording, name) for name in TOPICS}
    return replace(
        recording, **{n: replace(stream, stamp=stream.stamp + round(start * SECOND)) for n, stream in streams.items()}
    )


def with_slider(recording: Recording, order: np.ndarray) -> Recording:
    return replace(recording, slider=rows(recording.slider, order))


def day() -> list[Recording]:
    """The recordings that the sensors publish, one push each; at last the time jumps back to the beginning."""
    n = np.arange(len(clean(0.0).slider))
    future = clean(20.0)
    stamp, x, y = future.slider.stamp.copy(), future.slider.x.copy(), future.slider.y.copy()
    stamp[100] += DAY
    x[110], y[110] = 0.3, -0.2  # there and back
    x[120] = np.nan
    return [
        clean(0.0),
        # One late, three twice, and a dropout:
        with_slider(clean(10.0), np.r_[n[:50], n[51:60], 50, n[60:80], n[77:80], n[80:100], n[130:]]),
        replace(future, slider=replace(future.slider, stamp=stamp, x=x, y=y)),
        clean(0.0),
    ]


class Sensors:
    """Publishes recordings as a tracker, a robot and a force sensor would, with the time on /clock."""

    def __init__(self, node: Node) -> None:
        kinds = {"slider": PoseStamped, "pusher": PoseStamped, "wrench": WrenchStamped}
        self._out: dict[str, Publisher] = {n: node.create_publisher(kinds[n], t, 5000) for n, t in TOPICS.items()}
        self._clock = node.create_publisher(Clock, "/clock", 10)
        for publisher in (*self._out.values(), self._clock):
            assert wait_until(partial(_has_subscriber, publisher))

    def send(
        self,
        recording: Recording,
        names: tuple[str, ...] = tuple(TOPICS),
        pause: float = 0.01,
        until: Callable[[], bool] = lambda: False,
    ) -> None:
        """Send a recording in portions, with a pause (s) after each, until its end or until the condition holds."""
        longest = max(len(getattr(recording, name)) for name in names)
        for first in range(0, longest, PORTION):
            for name in names:
                for message in messages(getattr(recording, name), slice(first, first + PORTION)):
                    self._out[name].publish(message)
            now = recording.pusher.stamp[min(first, len(recording.pusher) - 1)]
            self._clock.publish(Clock(clock=ns_to_stamp(int(now))))
            if wait_until(until, pause):
                return


def _has_subscriber(publisher: Publisher) -> bool:
    return bool(publisher.get_subscription_count() > 0)


def messages(stream: PoseStream | WrenchStream, part: slice) -> list[bytes]:
    if isinstance(stream, WrenchStream):
        columns = np.column_stack([stream.fx, stream.fy, *np.zeros((3, len(stream))), stream.torque])
    else:
        turn = 0.5 * stream.heading
        zero = np.zeros_like(turn)
        columns = np.column_stack([stream.x, stream.y, stream.z, zero, zero, np.sin(turn), np.cos(turn)])
    return [stamped(int(s), row) for s, row in zip(stream.stamp[part], columns[part], strict=True)]


def offline(recordings: list[Recording]) -> PushTable:
    """The windows that reading the recordings one after another finds."""
    finder = WindowFinder(square_rig())
    windows = []
    for recording in recordings:
        assert recording.wrench is not None
        finder.add_wrench(recording.wrench)
        finder.add_pusher(recording.pusher)
        finder.add_slider(recording.slider)
        windows += finder.take_ready()
    return windows_to_table([*windows, *finder.finish()])


@pytest.mark.slow
def test_every_fault_is_counted_by_kind_and_gives_no_window(tmp_path: Path) -> None:
    model, rig, out = tmp_path / "model.pushmodel", tmp_path / "square.rig.yaml", tmp_path / "out"
    save_model(train_model(*square_pushes(20), "analytical", name="any"), model)
    save_rig(square_rig(), rig)
    recordings = day()
    expected_rows, domain = offline(recordings), free_domain()
    params = {"model": model, "rig": rig, "output": out, "report": False, "diagnostics_period": 0.2}
    with (
        ros_context(domain) as node,
        hosting_validator(domain=domain, params={**params, "use_sim_time": True}) as process,
    ):
        status, sensors = Status(node), Sensors(node)
        status.wait_for_first()
        for recording in recordings:
            sensors.send(recording)
        status.wait_for("streams clock_set_back", "1")
        values = status.values
        assert values["contact from"] == "geometry and force"
        expected = {"late": 1, "repeated": 3, "ahead": 1, "jumps": 1}
        assert {kind: int(values[f"slider {kind}"]) for kind in expected} == expected
        assert {kind: int(values[f"streams {kind}"]) for kind in expected} == expected
        assert values["slider rejected not finite"] == "1"
        assert values["streams resets"] == "2"  # between each two pushes
        assert int(values["slider dropouts"]) >= 1 + 2  # and one between each two pushes, which lie 10 s apart
        assert "1 samples with a stamp ahead" in status.message
        silent = "/pusher/wrench: No message for over 5 s."
        # The force sensor stops, the others continue.
        sensors.send(clean(10.0), ("slider", "pusher"), pause=0.3, until=lambda: silent in status.message)
        status.wait_for_message(silent)
        assert process.stop() == 0, process.text()
    table = read_table(out / "pushes.csv")
    count = len(expected_rows)
    assert 12 < count <= len(table)  # without a force the last push may have windows from the geometry
    assert table.inputs[:count] == pytest.approx(expected_rows.inputs, abs=1e-9)
    assert table.outcomes[:count] == pytest.approx(expected_rows.outcomes, abs=1e-9)
    assert table.outcomes == pytest.approx(np.tile([0.004, 0.0, 0.0], (len(table), 1)), abs=1e-9), (
        "the distance that the tip moved"
    )


def portion(slider: int, pusher: int) -> Samples:
    """One sample each at these times (ms)."""
    recording = clean(0.0)
    a, b = rows(recording.slider, np.array([0])), rows(recording.pusher, np.array([0]))
    assert recording.wrench is not None
    none = wrench_rows(recording.wrench, np.arange(0))
    at = [np.array([START + ms * 1_000_000]) for ms in (slider, pusher)]
    return Samples(replace(a, stamp=at[0]), replace(b, stamp=at[1]), none)


@pytest.mark.parametrize(("lag", "expected"), [(0, {}), (200, {}), (700, {"pusher": 0.7}), (-3000, {"pusher": -3.0})])
def test_reports_clocks_that_stay_apart(lag: int, expected: dict[str, float]) -> None:
    sync = StreamSync()
    for k in range(LAGS - 1):
        sync.note(portion(10 * k, 10 * k + lag))
    assert sync.apart() == {} and not sync.problems(), "too few portions"
    sync.note(portion(10 * LAGS, 10 * LAGS + lag))
    assert sync.apart() == pytest.approx(expected, abs=0.011)
    assert [("ahead of" if lag > 0 else "behind") in text for text in sync.problems()] == [True] * len(expected)


def test_an_occasional_lag_is_not_a_clock_offset() -> None:
    sync = StreamSync()
    for k in range(2 * LAGS):
        sync.note(portion(10 * k, 10 * k - (2000 if k % 10 else 0)))
    assert sync.apart() == {}
