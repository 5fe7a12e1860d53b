# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Refuses a module that should have been compiled and was not: as Python it would be more than ten times slower."""

from __future__ import annotations

import sys

from push_predictor.errors import NotCompiledError

REMEDY = "`pip install -e .` in its folder (needs a C compiler), or build it with colcon"


def require_compiled(file: str) -> None:
    """Raise NotCompiledError if the module of this file is Python code. Called before the module imports `cython`."""
    if file.endswith(".py"):
        version = ".".join(map(str, sys.version_info[:2]))
        raise NotCompiledError(
            f"the compiled mechanics of push_predictor are missing ({file}, Python {version}): run {REMEDY}"
        )
