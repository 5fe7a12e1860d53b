# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The report of a live validation: it opens with the judgement of the live alarm."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from push_predictor.online import live_validation

FIRED = {"fired": True}


@pytest.fixture
def handlers() -> Iterator[None]:
    """The signal handlers of this process, which the function of the report's process replaces."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("handlers")
def test_report_has_the_alarm_of_the_live_validation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[str, Any] = {}
    monkeypatch.setattr(live_validation, "report_windows", lambda *_, **named: given.update(named))
    live_validation.write_report(None, [], live_validation.WindowRows(), [], tmp_path, FIRED)
    assert given == {"alarm": FIRED}


@pytest.mark.ros
@pytest.mark.parametrize(("alarm", "expected"), [(SimpleNamespace(json=FIRED), FIRED), (None, None)])
def test_validator_passes_its_alarm_to_the_report(tmp_path: Path, alarm: Any, expected: object) -> None:
    from push_predictor.nodes.validator.results import ResultWriter

    started: list[object] = []
    live = SimpleNamespace(names=[], windows=[1], predicted=lambda: [1], reported=lambda: ("reported",))
    run: Any = SimpleNamespace(validation=live, alarm=alarm, write=lambda folder: [folder / "validation.json"])
    writer = ResultWriter(str(tmp_path), SimpleNamespace(info=lambda text: None))
    writer.report = SimpleNamespace(start=lambda *arguments: started.extend(arguments))  # type: ignore[assignment]  # a fake
    assert not writer.write(run, with_report=True)
    assert started == ["reported", tmp_path, expected]
