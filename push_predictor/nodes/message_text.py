# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The `ros2msg` definition of an installed message type, as a bag contains it."""

from __future__ import annotations

import re

from push_predictor.nodes.replay.topics import message_class

_RULE = "=" * 80
_NAMES = {"double": "float64", "float": "float32", "boolean": "bool", "octet": "byte"}
_SEQUENCE = re.compile(r"sequence<(.+?)(?:, \d+)?>")


def definition_of(kind: str) -> str:
    """The text of a type package/msg/Name and of all types in it. Raises PushPredictorError if it is not installed."""
    parts, found = [], [kind]
    for name in found:
        lines, nested = _lines(name)
        parts.append(lines if name == kind else f"{_RULE}\nMSG: {name.replace('/msg/', '/')}\n{lines}")
        found += [other for other in dict.fromkeys(nested) if other not in found]
    return "".join(parts)


def _lines(kind: str) -> tuple[str, list[str]]:
    """The fields of a type as text, and the message types of its fields."""
    fields: dict[str, str] = message_class(kind).get_fields_and_field_types()  # type: ignore[attr-defined]  # all have it
    lines, nested = [], []
    for name, text in fields.items():
        sequence = _SEQUENCE.fullmatch(text)
        element, _, length = (f"{sequence[1]}[]" if sequence else text).partition("[")
        element = re.sub(r"<\d+>$", "", element)
        if "/" in element:
            nested.append(element.replace("/", "/msg/"))
        lines.append(f"{_NAMES.get(element, element)}{'[' if length else ''}{length} {name}\n")
    return "".join(lines), nested
