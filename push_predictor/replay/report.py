# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The report of a replay: the diagnostics of each second and the summary at the end."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from push_predictor.replay.lateness import Delays


@dataclass(frozen=True)
class ReplayReport:
    """State of a replay; behind in s, acknowledged None before the end.

    late: delay of the messages up to the call that publishes them; late_after: up to its return.
    problems: what the check of the recording found; check: its result.
    """

    recording: str
    state: str
    rate: float
    published: int
    late: Delays
    late_after: Delays
    behind: float
    lost: int
    acknowledged: bool | None
    skipped: Mapping[str, str] = field(default_factory=dict)
    unstamped: Sequence[str] = ()
    damage: Sequence[str] = ()
    rig: str = ""
    problems: Sequence[str] = ()
    check: str = ""

    @property
    def warnings(self) -> list[str]:
        """What an operator should know, most serious first."""
        warnings = [f"subscribers may have lost {self.lost} messages"] if self.lost else []
        warnings += ["not all messages were acknowledged by the subscribers"] if self.acknowledged is False else []
        warnings += [f"damaged: {text}" for text in self.damage]
        warnings += [f"{self.behind:.3f} s behind schedule"] if self.behind > 0.1 else []
        warnings += [f"not published: {topic} ({why})" for topic, why in self.skipped.items()]
        warnings += [f"not restamped: {topic} (its type does not begin with a header)" for topic in self.unstamped]
        return [*warnings, *([self.rig] if self.rig else []), *self.problems]

    @property
    def values(self) -> dict[str, str]:
        """Key and value of each figure, for /diagnostics."""
        return {
            "state": self.state,
            "recording": self.recording,
            "rate": f"{self.rate:g}",
            "published": str(self.published),
            "late_p50_us": f"{self.late.p50:.1f}",
            "late_p99_us": f"{self.late.p99:.1f}",
            "late_max_us": f"{self.late.maximum:.1f}",
            "late_after_p50_us": f"{self.late_after.p50:.1f}",
            "late_after_p99_us": f"{self.late_after.p99:.1f}",
            "late_after_max_us": f"{self.late_after.maximum:.1f}",
            "behind_s": f"{self.behind:.6f}",
            "lost": str(self.lost),
            "acknowledged": {None: "unknown", True: "yes", False: "no"}[self.acknowledged],
            "not_published": json.dumps(dict(self.skipped)),
            "damage": "; ".join(self.damage),
            "data_check": self.check,
        }

    @property
    def summary(self) -> str:
        """One line for the log."""
        figures = (
            f"{self.state}: published {self.published} messages of {self.recording} at rate {self.rate:g}, "
            f"late {self.late.to_text()}, after publishing {self.late_after.to_text()}, "
            f"lost {self.lost}, acknowledged {self.values['acknowledged']}"
        )
        return "; ".join([figures, *self.warnings])
