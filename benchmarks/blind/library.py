# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The trace without one mechanism of its library, whose effects must then come back as unknown."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from push_predictor.models.mechanisms import LIBRARY


@contextmanager
def library_without(mechanism: str | None) -> Iterator[None]:
    """Remove a mechanism from LIBRARY in every module of push_predictor.residuals; None: change nothing.

    Raises SystemExit for a mechanism that is not in the library.
    """
    if mechanism is None:
        yield
        return
    if mechanism not in {entry.name for entry in LIBRARY}:
        raise SystemExit(f"--without: {mechanism!r} is not in the library")
    less = tuple(entry for entry in LIBRARY if entry.name != mechanism)
    holders = [module for name, module in sys.modules.items() if _searches(name, module)]
    for module in holders:
        vars(module)["LIBRARY"] = less
    try:
        yield
    finally:
        for module in holders:
            vars(module)["LIBRARY"] = LIBRARY


def _searches(name: str, module: object) -> bool:
    return name.startswith("push_predictor.residuals.") and getattr(module, "LIBRARY", None) is LIBRARY
