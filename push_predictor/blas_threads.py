# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Linear algebra of small matrices on one thread: more threads cost twelve times the CPU time and save none."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpoolctl import LibController

VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


_process = {"limited": False}


def limit_process() -> None:
    """Limit this process and its children to one thread, unless the environment sets another number.

    Call it before numpy is imported: a BLAS reads the environment once.
    """
    for name in VARIABLES:
        os.environ.setdefault(name, "1")
    _process["limited"] = "numpy" not in sys.modules and all(os.environ[name] == "1" for name in VARIABLES)


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread, whatever the environment asks for."""
    if _process["limited"]:
        yield
        return
    libraries = _libraries()
    before = [library.get_num_threads() for library in libraries]
    try:
        for library in libraries:
            library.set_num_threads(1)
        yield
    finally:
        for library, threads in zip(libraries, before, strict=True):
            library.set_num_threads(threads)


@lru_cache(maxsize=1)
def _libraries() -> list[LibController]:
    """The BLAS libraries of numpy and scipy, none without threadpoolctl.

    To find them takes a thousand times as long as to limit them.
    """
    import scipy.linalg  # noqa: F401 (its BLAS must be limited too, and would be loaded later)

    try:
        from threadpoolctl import ThreadpoolController
    except ImportError:  # on a robot, whose nodes are limited by `limit_process`
        return []
    return [library for library in ThreadpoolController().lib_controllers if library.user_api == "blas"]
