# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The report of a replay: the diagnostics of each second and the summary at the end."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

LAST = 100_000  # messages over which percentiles are taken


@dataclass(frozen=True)
class Delays:
    """Percentiles of the lateness of the last messages, and the maximum of all, us."""

    p50: float
    p99: float
    maximum: float

    def to_text(self) -> str:
        """The figures without decimals."""
        return f"p50 {self.p50:.0f} us, p99 {self.p99:.0f} us, max {self.maximum:.0f} us"


class Lateness:
    """How late messages are."""

    def __init__(self) -> None:
        self._last: deque[int] = deque(maxlen=LAST)
        self.maximum = 0  # ns

    def add(self, late: int) -> None:
        """Add one message, ns; before its time counts as 0."""
        self._last.append(max(late, 0))
        self.maximum = max(self.maximum, late)

    def delays(self) -> Delays:
        """The figures so far."""
        p50, p99 = np.quantile(list(self._last) or [0], (0.5, 0.99), method="higher").tolist()
        return Delays(p50 / 1000.0, p99 / 1000.0, self.maximum / 1000.0)


@dataclass(frozen=True)
class ReplayReport:
    """State of a replay; behind in s, acknowledged None before the end.

    late: delay of the messages up to the call that publishes them.
    problems: what the check of the recording found; check: its result.
    """

    recording: str
    state: str
    rate: float
    published: int
    late: Delays
    behind: float
    lost: int
    acknowledged: bool | None
    skipped: Mapping[str, str] = field(default_factory=dict)
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
            f"late {self.late.to_text()}, lost {self.lost}, acknowledged {self.values['acknowledged']}"
        )
        return "; ".join([figures, *self.warnings])
