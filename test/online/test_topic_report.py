# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The report about a live topic: figures of its stamps, and one line when something has changed."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from synthetic import translating_push

from push_predictor.online import stream_health
from push_predictor.online.news import News
from push_predictor.online.stream_health import StreamSync, TopicReport, stamp_figures
from push_predictor.recordings.decoder.decoder import Samples
from push_predictor.recordings.streams import taken

SECOND = 1_000_000_000
REPORT = TopicReport("slider", "/vicon/block", "geometry_msgs/msg/PoseStamped", "best effort", ("world",))


def stamps(n: int, rate: float, jitter: float = 0.0) -> np.ndarray:
    noise = np.random.default_rng(0).normal(0.0, jitter, n)
    return np.asarray(1_700_000_000 * SECOND + np.round((np.arange(n) / rate + noise) * SECOND), dtype=np.int64)


def numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"[\d.]+", text)]


def test_rate_jitter_and_latency_of_a_tracker() -> None:
    stamp = stamps(250, 100.0, 0.0005)
    found = stamp_figures(stamp, stamp + 3_000_000)
    assert re.fullmatch(r"\S+ Hz, stamp jitter \S+ ms, latency 3 ms", found)
    assert numbers(found) == [pytest.approx(100.0, rel=0.02), pytest.approx(0.5, rel=0.2), 3.0]


def test_a_gap_is_no_jitter() -> None:
    stamp = stamps(250, 100.0)
    stamp[100:] += 5 * SECOND
    assert numbers(stamp_figures(stamp, stamp)) == pytest.approx([100.0, 0.0, 0.0], abs=0.05)


@pytest.mark.parametrize("apart", [86_400 * SECOND, -86_400 * SECOND])
def test_a_latency_of_days_is_another_clock(apart: int) -> None:
    stamp = stamps(50, 100.0)
    assert stamp_figures(stamp, stamp + apart).endswith("ms, stamps of another clock")


def test_without_times_of_receipt_there_is_no_latency() -> None:
    assert stamp_figures(stamps(50, 100.0), None) == "100.0 Hz, stamp jitter 0 ms"


@pytest.mark.parametrize("stamp", [stamps(9, 100.0), np.full(20, SECOND)])
def test_few_or_equal_stamps_have_no_figures(stamp: np.ndarray) -> None:
    assert stamp_figures(stamp, stamp) == ""


def test_the_line_has_everything_that_is_known() -> None:
    figures = "100.0 Hz, stamp jitter 2.1 ms, latency 4 ms"
    line = replace(REPORT, figures=figures, problem="frame_id 'map' is not accepted.").line
    assert line == (
        "slider: /vicon/block, geometry_msgs/msg/PoseStamped, best effort, frame_id 'world', 100.0 Hz, "
        "stamp jitter 2.1 ms, latency 4 ms. frame_id 'map' is not accepted."
    )
    assert replace(REPORT, reliability="", frames=(), note="No publisher.").line == (
        "slider: /vicon/block, geometry_msgs/msg/PoseStamped. No publisher."
    )


def test_a_change_that_stays_is_news_once() -> None:
    news = News()

    def told(*reports: TopicReport) -> list[list[str]]:
        return [news.of({report.stream: report.key}) for report in reports]

    assert told(REPORT, REPORT, REPORT) == [[], ["slider"], []]
    faster = replace(REPORT, figures="100.0 Hz")
    assert told(faster, REPORT, REPORT) == [[], [], []], "it did not stay"
    assert told(faster, faster, faster) == [[], ["slider"], []]
    assert told(replace(faster, figures="101.0 Hz")) == [[]], "figures alone are no change"
    for other in (replace(faster, problem="No publisher."), replace(faster, reliability="reliable")):
        assert told(other, other, other) == [[], ["slider"], []]
    at_once = News(at_once=True)
    assert [at_once.of(dict.fromkeys(present, "")) for present in ("a", "ab", "", "a")] == [["a"], ["b"], [], ["a"]]
    assert at_once.gone("a") == [] and at_once.gone("b") == ["a"]


# --- streams in step ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stopped", ["slider", "pusher"])
def test_a_sensor_that_stops_is_named_and_its_stamps_are_not_taken_for_another_clock(
    monkeypatch: pytest.MonkeyPatch, stopped: str
) -> None:
    """Whatever it comes from: a topic, or a frame of a /tf on which other frames continue."""
    sync, recording = StreamSync(), translating_push()
    none = taken(recording.wrench, slice(0, 0))

    def play(begin: int, end: int, *names: str) -> None:
        for tick in range(begin, end):  # of 0.1 s
            monkeypatch.setattr(stream_health, "monotonic", lambda tick=tick: 0.1 * tick)
            at = {name: replace(taken(recording.slider, slice(0, 1)), stamp=np.array([10**8 * tick])) for name in names}
            gone = taken(recording.slider, slice(0, 0))
            sync.note(Samples(at.get("slider", gone), at.get("pusher", gone), none))

    play(0, 60, "slider", "pusher")
    assert sync.problems() == []
    (other,) = {"slider", "pusher"} - {stopped}
    play(60, 79, other)
    assert sync.problems() == []
    play(79, 200, other)
    assert sync.problems() == [f"No sample from the {stopped} for 2 s, others continue: no window can be found."]
    assert sync.apart() == {}
