# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Definitions in IDL (schema encoding `ros2idl`) as `ros2msg` text: rosbag2 records them where a type has no .msg."""

from __future__ import annotations

import re

_RULE = "=" * 80
_SECTION = re.compile(r"^=+\s*\nIDL: *(\S+) *$", re.MULTILINE)
_NOT_READ = re.compile(
    r"//[^\n]*|/\*.*?\*/|#[^\n]*|@\w+\s*(?:\((?:[^()\"]|\"(?:\\.|[^\"\\])*\")*\))?", re.DOTALL
)  # comments, includes and annotations
_TYPEDEF = re.compile(r"typedef\s+([^;]+?)\s+(\w+)((?:\[\d+\])?)\s*;")
_STRUCT = re.compile(r"struct\s+(\w+)\s*\{(.*?)\}", re.DOTALL)
_MEMBER = re.compile(r"\s*(.+?)\s+(\w+)\s*((?:\[\d+\])?)\s*$", re.DOTALL)
_SEQUENCE = re.compile(r"sequence\s*<\s*(.+?)\s*(?:,\s*\d+\s*)?>")
_NUMBERS = {
    "double": "float64",
    "float": "float32",
    "boolean": "bool",
    "octet": "byte",
    "short": "int16",
    "unsigned short": "uint16",
    "long": "int32",
    "unsigned long": "uint32",
    "long long": "int64",
    "unsigned long long": "uint64",
}


def msg_of_idl(text: str) -> str:
    """The `ros2msg` text of IDL text, whose first section is the type itself; '' if there is no section."""
    _, *parts = _SECTION.split(text)
    found = [(name, _fields(name, part)) for name, part in zip(parts[::2], parts[1::2], strict=True)]
    return f"{_RULE}\n".join(fields if k == 0 else f"MSG: {name}\n{fields}" for k, (name, fields) in enumerate(found))


def _fields(type_name: str, text: str) -> str:
    """One line for each member of the struct of a type, '' without it."""
    plain = _NOT_READ.sub(" ", text)
    aliases = {alias: (_type(kind), length) for kind, alias, length in _TYPEDEF.findall(plain)}
    members = next((body for name, body in _STRUCT.findall(plain) if name == type_name.rpartition("/")[2]), "")
    lines = []
    for member in filter(None, map(_MEMBER.match, members.split(";"))):
        kind, name, length = member.groups()
        kind, own = aliases.get(kind, (_type(kind), ""))
        lines.append(f"{kind}{own or length} {name}\n")
    return "".join(lines)


def _type(text: str) -> str:
    """The type of `ros2msg`, of a sequence with brackets."""
    if sequence := _SEQUENCE.fullmatch(text.strip()):
        return f"{_type(sequence[1])}[]"
    name = " ".join(text.split())
    if re.fullmatch(r"w?string(\s*<\s*\d+\s*>)?", name):
        return name.partition("<")[0].strip()
    return _NUMBERS.get(name, name.replace("::msg::", "/").replace("::", "/"))
