# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The definitions of message types from the .msg files of the installed packages, as an MCAP file contains them."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from push_predictor.errors import RecordingError
from push_predictor.recordings.fields.message_text import parse_definitions

_RULE = "=" * 80


def definition_text(type_name: str, shares: Sequence[Path] | None = None) -> str:
    """The `ros2msg` text of a type such as std_msgs/msg/Header, followed by those of all types in it.

    shares: folders with PACKAGE/msg/NAME.msg; those of the ROS installation by default. Raises RecordingError that
    names the missing file and where it was looked for.
    """
    places = _installed() if shares is None else shares
    texts: dict[str, str] = {}
    waiting = [type_name.replace("/msg/", "/")]
    while waiting:
        name = waiting.pop(0)
        if name not in texts:
            texts[name] = _text(name, places)
            waiting += _types_in(name, texts[name])
    first, *others = texts.items()
    return "".join([first[1], *(f"{_RULE}\nMSG: {name}\n{text}" for name, text in others)])


def _installed() -> list[Path]:
    prefixes = filter(None, [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix])
    return [Path(prefix) / "share" for prefix in dict.fromkeys(prefixes)]


def _text(type_name: str, shares: Sequence[Path]) -> str:
    """The definition of package/Name."""
    package, _, name = type_name.partition("/")
    for share in shares:
        file = share / package / "msg" / f"{name}.msg"
        if file.is_file():
            return file.read_text(encoding="utf-8").rstrip("\n") + "\n"
    raise RecordingError(f"{package}/msg/{name}.msg: not found in {', '.join(map(str, shares))}")


def _types_in(type_name: str, text: str) -> Iterator[str]:
    """package/Name of each message type among the fields of a definition."""
    for fields in parse_definitions(type_name, text).values():
        yield from (field.type for field in fields if "/" in field.type)
