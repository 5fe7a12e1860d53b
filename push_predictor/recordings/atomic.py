# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Atomic writing: a file exists completely or not at all."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO

_NUMBERS = itertools.count()  # several threads of a process may write the same file


def write_whole(path: Path, content: bytes | Iterable[bytes]) -> None:
    """Write a file atomically, through a temporary file in the same folder; missing folders are created.

    content: the bytes, or portions of them. A link remains a link; a device such as /dev/null is written to. Raises
    OSError that names the path; then an earlier file is unchanged and the temporary file is removed.
    """
    target = Path(os.path.realpath(path))
    try:
        if target.exists() and not (target.is_file() or target.is_dir()):
            with target.open("wb") as device:
                _fill(device, content)
            return
        target.parent.mkdir(parents=True, exist_ok=True)
        _replace(target, content)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None


def _replace(target: Path, content: bytes | Iterable[bytes]) -> None:
    temporary = target.with_name(f".{os.getpid()}-{next(_NUMBERS)}.unfinished")
    try:
        with temporary.open("xb") as stream:
            _fill(stream, content)
            stream.flush()
            os.fsync(stream.fileno())  # some file systems report only now that they are full
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def _fill(stream: BinaryIO, content: bytes | Iterable[bytes]) -> None:
    stream.writelines((content,) if isinstance(content, bytes) else content)
