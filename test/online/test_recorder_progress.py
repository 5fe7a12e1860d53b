# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The progress of a recording: rates, gaps, missing messages, and the line that shows them."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from push_predictor.online.recorder_progress import LOG_PERIOD, LiveLine, Pace, Progress


def stamps(*seconds: float) -> np.ndarray:
    return np.array([round(second * 1e9) for second in seconds], np.int64)


def test_gaps_are_found_within_and_between_portions() -> None:
    pace = Pace(0.0)
    pace.add(stamps(10.0, 10.1), 1.0)
    assert pace.largest_gap == pytest.approx(0.1)
    pace.add(stamps(10.6, 10.7), 2.0)
    assert pace.largest_gap == pytest.approx(0.5) and pace.samples == 4
    assert pace.rate == pytest.approx(3 / 0.7)


def test_a_slow_stream_may_be_silent_for_four_periods() -> None:
    fast, slow = Pace(0.0), Pace(0.0)
    fast.add(stamps(0.0, 0.1), 1.0)
    slow.add(stamps(0.0, 2.0), 2.0)
    assert fast.silent(3.9) == 0.0 and fast.silent(4.0) == pytest.approx(3.0)
    assert slow.silent(9.9) == 0.0 and slow.silent(10.0) == pytest.approx(8.0)


def stream(name: str, source: str, samples: int, rate: float, largest_gap: float) -> Any:
    """In place of a Pace."""
    return SimpleNamespace(name=name, source=source, samples=samples, rate=rate, largest_gap=largest_gap)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_slow_covariate_is_no_gap_of_the_streams(progress: Callable[..., Progress]) -> None:
    slow = stream("/warmth", "/warmth", 3, 0.5, 2.0)
    whole = replace(progress(), streams=(*progress().streams, slow))
    assert "largest gap 21 ms (slider)" in whole.to_line()
    assert "\n  /warmth: 3 samples, 0.5 Hz, largest gap 2 s" in whole.to_text()


@pytest.fixture
def progress() -> Callable[..., Progress]:
    def made(**problems: str) -> Progress:
        figures = (stream("slider", "/a", 250, 99.96, 0.021), stream("pusher", "/b", 500, 200.0, 0.011))
        return Progress("monday", 2.5, {"/a": 250, "/b": 500}, figures, 12, 3, 0.416, problems)

    return made


def test_a_terminal_gets_one_line_that_fits(progress: Callable[..., Progress], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    log, terminal = list[str](), Terminal()
    line = LiveLine(log.append, log.append, terminal)
    line.show(progress(), 0.0)
    line.show(progress(), 1.0)
    written = terminal.getvalue().split("\r\x1b[K")[1:]
    assert written == ["2.5 s, 12 windows of 3 pushes, contact…"] * 2 and len(written[0]) == 39 and not log


def test_without_a_terminal_a_line_is_logged_every_few_seconds(progress: Callable[..., Progress]) -> None:
    log, warned, stream = list[str](), list[str](), io.StringIO()
    line = LiveLine(log.append, warned.append, stream)
    for second in range(11):
        line.show(progress(), float(second))
    assert LOG_PERIOD == 5.0 and len(log) == 3 and not warned and not stream.getvalue()


def test_a_problem_is_logged_once_if_it_lasts_and_again_if_it_comes_back(progress: Callable[..., Progress]) -> None:
    warned = list[str]()
    line = LiveLine(lambda text: None, warned.append, io.StringIO())
    for problems in ({"a": "A."}, {}, {"a": "A."}, {"a": "A for 2 s."}, {"a": "A for 3 s."}, {}):
        line.show(progress(**problems), 0.0)
    assert warned == ["A for 2 s."]
    for _ in range(2):
        line.show(progress(a="A."), 0.0)
    assert warned == ["A for 2 s.", "A."]


def test_the_summary_names_every_stream_and_problem(progress: Callable[..., Progress]) -> None:
    summary = progress(wrench="No publisher of /w.")
    assert len(summary.to_text().splitlines()) == 4 and summary.to_text().endswith("No publisher of /w.")
    assert summary.to_json()["streams"] == {
        "/a": {"stream": "slider", "samples": 250, "rate": 99.96, "largest_gap": 0.021},
        "/b": {"stream": "pusher", "samples": 500, "rate": 200.0, "largest_gap": 0.011},
    }
