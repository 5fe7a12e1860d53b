# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A level, a message and named values -> diagnostic_msgs."""

from __future__ import annotations

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from msg_adapters import ns_to_stamp


def level_of(failed: object, problems: object) -> bytes:
    """The level of a status: ERROR if something failed, WARN if there are problems, else OK."""
    level: bytes = DiagnosticStatus.WARN if problems else DiagnosticStatus.OK
    return DiagnosticStatus.ERROR if failed else level


def diagnostic_status(
    node: str, subject: str, level: bytes, message: str, values: Mapping[str, object], hardware_id: str
) -> DiagnosticStatus:
    """The status of one subject of a node, named `NODE: SUBJECT` as diagnostic_updater names its tasks.

    node: its fully qualified name. level: a constant of DiagnosticStatus. hardware_id: name of the rig, model or
    recording that the status is about, '' while there is none. Of the values, floats get six digits, lists commas; None
    becomes '-'.
    """
    name = f"{node}: {subject}"
    pairs = [KeyValue(key=key, value=_text(value)) for key, value in values.items()]
    return DiagnosticStatus(level=level, name=name, message=message, hardware_id=hardware_id, values=pairs)


def diagnostic_array(stamp_ns: int, *statuses: DiagnosticStatus) -> DiagnosticArray:
    """The message for /diagnostics; stamp_ns in ns."""
    array = DiagnosticArray(status=list(statuses))
    array.header.stamp = ns_to_stamp(stamp_ns)
    return array


def _text(value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return ", ".join(_text(item) for item in value) or "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
