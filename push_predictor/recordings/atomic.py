"""Files that are there whole or not at all, whatever happens while they are written."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO

_NUMBERS = itertools.count()  # threads of one process may write the same file


def write_whole(path: Path, content: bytes | Iterable[bytes]) -> None:
    """Write a file by way of a temporary one beside it, so that no reader sees half of it; folders are made.

    content: the bytes, or portions of them. A link stays a link, a device such as /dev/null is written to. Raises
    OSError that names the path; then an older file is as it was, and nothing lies beside it.
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
            os.fsync(stream.fileno())  # some file systems say only now that they are full
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def _fill(stream: BinaryIO, content: bytes | Iterable[bytes]) -> None:
    stream.writelines((content,) if isinstance(content, bytes) else content)
