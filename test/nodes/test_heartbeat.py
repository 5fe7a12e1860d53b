"""Heartbeat: beats come while everything else is busy, and after one that failed."""

from __future__ import annotations

import time

from push_predictor.nodes.server.heartbeat import Heartbeat


def test_a_beat_that_fails_is_told_and_not_the_last():
    beats, failures = [], []

    def beat() -> None:
        beats.append(len(beats))
        if len(beats) == 1:
            raise ZeroDivisionError("a bug")

    heartbeat = Heartbeat(0.01, beat, failures.append)
    end = time.monotonic() + 10.0
    while len(beats) < 3 and time.monotonic() < end:
        time.sleep(0.01)
    heartbeat.end()
    assert len(beats) >= 3
    assert [str(error) for error in failures] == ["a bug"]
    seen = len(beats)
    time.sleep(0.05)
    assert len(beats) == seen
