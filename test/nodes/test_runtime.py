"""The end of a node process: a request is obeyed wherever the main thread happens to be."""

from __future__ import annotations

import sys
import threading
from types import FrameType
from typing import Any

import pytest

from push_predictor.nodes.runtime import Stop


@pytest.mark.parametrize("events_before", range(6))
def test_a_signal_handler_may_request_the_end_at_any_point_of_the_wait(events_before: int) -> None:
    """Python runs handlers between two instructions of the main thread, also while it holds a lock inside wait()."""
    stop = Stop()
    seen = 0

    def handle(frame: FrameType, event: str, argument: Any) -> None:
        nonlocal seen
        if seen == events_before:
            sys.setprofile(None)
            stop.request()
        seen += 1

    def wait() -> None:
        sys.setprofile(handle)
        stop.wait()
        sys.setprofile(None)

    waiter = threading.Thread(target=wait, daemon=True)
    waiter.start()
    waiter.join(0.5)
    stop.request()  # for a wait that has fewer events than this
    waiter.join(5.0)
    assert not waiter.is_alive()


def test_the_first_error_is_kept_and_ends_the_wait() -> None:
    stop = Stop()
    first = RuntimeError("first")
    stop.fail(first)
    stop.fail(RuntimeError("second"))
    stop.wait()
    assert stop.error is first
