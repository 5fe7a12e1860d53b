# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The check of samples or of a recording at once, in this process: the start of another takes most of the time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import SimpleNamespace
from unittest.mock import patch

from push_predictor.online import check_process


@contextmanager
def checking_in_this_process() -> Iterator[None]:
    def start(target: Callable[..., None], arguments: Sequence[object], name: str) -> object:
        target(*arguments)
        return SimpleNamespace(terminate=lambda: None, join=lambda: None)

    with patch.object(check_process, "start_child", start), patch.object(check_process.os, "nice", lambda more: None):
        yield
