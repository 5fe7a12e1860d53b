# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Atomic writing: a file, or a line that is appended to one, exists completely or not at all."""

from __future__ import annotations

import errno
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


def append_lines(path: Path, lines: Iterable[str]) -> None:
    """Append lines, each with a single write, also when the process is killed or the disk is full.

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


def _append(descriptor: int, data: bytes) -> None:
    before = os.fstat(descriptor).st_size
    if os.write(descriptor, data) < len(data):
        os.ftruncate(descriptor, before)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
