# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The check of samples or of a recording at once, in this process: the start of another takes most of the time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from unittest.mock import patch

from push_predictor.online import check_process
from push_predictor.online.child_process import attempt


class Here:
    """A Child that works at once, in this process."""

    def __init__(self, name: str, work: Callable[..., None]) -> None:
        self._work, self._sent = work, list[object]()
        self.started = False

    def start(self, *arguments: object) -> None:
        attempt(self._work, SimpleNamespace(send=self._sent.append), *arguments)
        self.started = True

    def received(self) -> object:
        return self._sent.pop(0) if self._sent else None

    def stop(self) -> None:
        self.started = False


@contextmanager
def checking_in_this_process() -> Iterator[None]:
    with patch.object(check_process, "Child", Here):
        yield
