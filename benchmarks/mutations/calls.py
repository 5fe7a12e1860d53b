# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A pytest plugin that notes which test file calls which functions of the sources, and how long it takes.

python -m pytest -p benchmarks.mutations.calls --calls FOLDER
"""

from __future__ import annotations

import json
import os
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest

from benchmarks.mutations.mutants import ROOT, SOURCES


class Calls:
    """The functions that each test file calls; written into the folder when the process ends, one file a process."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._codes: dict[str, set[CodeType]] = {}
        self._seconds: dict[str, float] = {}
        self._failed: set[str] = set()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Note the functions called while one test runs, in all threads."""
        seen = self._codes.setdefault(str(item.path.relative_to(ROOT)), set())

        def note(frame: FrameType, event: str, _argument: object) -> None:
            if event == "call":
                seen.add(frame.f_code)

        threading.setprofile(note)
        sys.setprofile(note)
        try:
            return (yield)
        finally:
            sys.setprofile(None)
            threading.setprofile(None)

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Add up the time of each file, and note the files that fail on the sound code."""
        file = report.location[0]
        self._seconds[file] = self._seconds.get(file, 0.0) + report.duration
        if report.failed:
            self._failed.add(file)

    def pytest_sessionfinish(self) -> None:
        """Write what was noted; the process that only hands out tests to others has noted nothing."""
        if not self._codes:
            return
        self._folder.mkdir(parents=True, exist_ok=True)
        calls = {
            file: sorted(map(list, {name for code in codes if (name := _name(code))}))
            for file, codes in self._codes.items()
        }
        text = json.dumps({"calls": calls, "seconds": self._seconds, "failed": sorted(self._failed)})
        (self._folder / f"{os.getpid()}.json").write_text(text)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option --calls."""
    parser.addoption("--calls", type=Path)


def pytest_configure(config: pytest.Config) -> None:
    """Register the plugin where the option is given."""
    if folder := config.getoption("--calls"):
        config.pluginmanager.register(Calls(folder))


def _name(code: CodeType) -> tuple[str, str] | None:
    """File and qualified name of a function of the sources, lambdas and comprehensions as their function."""
    file = code.co_filename.removeprefix(f"{ROOT}/")
    if not file.startswith(SOURCES):
        return None
    qualified = code.co_qualname.split(".<")[0] if hasattr(code, "co_qualname") else code.co_name
    return file, qualified
