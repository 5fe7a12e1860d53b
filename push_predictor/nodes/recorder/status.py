# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The health of a push_recorder as a diagnostic status."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticStatus

from msg_adapters.diagnostics import Level, diagnostic_status
from push_predictor.online.recorder.progress import Progress
from push_predictor.recordings.rig import Rig


def recorder_status(node_name: str, progress: Progress, rig: Rig | None) -> DiagnosticStatus:
    """WARN while something is missing. The message has the problems, the values the figures of every stream."""
    values: dict[str, object] = {"state": "recording" if progress.started else "waiting for messages"}
    values |= {"bag": progress.path, "seconds": progress.seconds, "messages": sum(progress.messages.values())}
    values |= {"windows": progress.windows, "pushes": progress.pushes, "share of contact": progress.contact}
    for each in progress.streams:
        values |= {f"{each.name} samples": each.samples, f"{each.name} rate": each.rate}
        values[f"{each.name} largest gap"] = each.largest_gap
    level = Level.WARN if progress.problems else Level.OK
    message = " ".join(progress.problems.values()) or str(values["state"])
    return diagnostic_status(node_name, "recording", level, message, values, rig.shape if rig else "")
