# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Atomic appending: a line of a text file is written completely or not at all.

This holds also when the process is killed or the disk is full.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable
from pathlib import Path


def append_lines(path: Path, lines: Iterable[str]) -> None:
    """Append lines, each with a single write.

    Raises OSError that names the path, for example on a full disk; the file then ends with the last complete line.
    """
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        try:
            for line in lines:
                _append(descriptor, f"{line}\n".encode())
        finally:
            os.close(descriptor)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None


def _append(descriptor: int, data: bytes) -> None:
    before = os.fstat(descriptor).st_size
    if os.write(descriptor, data) < len(data):
        os.ftruncate(descriptor, before)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
