# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The result of one check of a recording or a push table, and what the checks know of a recording so far."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Literal, TypeAlias

from push_predictor.recordings.checks.motion import Motion, motion_of
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.windows.push_window import PushWindow

Severity: TypeAlias = Literal["refused", "warning", "note"]


@dataclass(frozen=True)
class Value:
    """An estimated number, its unit, and its standard deviation in the same unit (None if none is known)."""

    value: float
    unit: str
    sd: float | None = None


@dataclass(frozen=True)
class Finding:
    """A probable mistake. refused: nothing can be learnt from these data; warning: check before learning.

    sentence states what was found, advice what to do. values: estimates by name.
    """

    name: str
    severity: Severity
    sentence: str
    advice: str
    values: dict[str, Value] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The finding and the advice, in one line."""
        return f"{self.sentence} {self.advice}"

    @property
    def lines(self) -> list[str]:
        """Lines to print: the finding and, below it, the advice."""
        return [f"{self.severity:8s} {self.name:16s} {self.sentence}", f"{'':25s} -> {self.advice}"]

    def record(self) -> dict[str, object]:
        """The entry in the JSON."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Evidence:
    """A recording, as far as the stages so far accept its samples, its rig, and what they found.

    A stage takes it and returns it with its own findings. It does not look for what an earlier finding explains.
    recorded: the recording as it was given, None if it is the same. synchronous: whether single pushes show that the
    accepted stamps of slider and tip are on one clock. windows: of the recording as it was given, None where no stage
    looked for them.
    """

    recording: Recording
    rig: Rig
    findings: tuple[Finding, ...] = ()
    recorded: Recording | None = None
    synchronous: bool = False
    windows: Sequence[PushWindow] | None = None

    @property
    def refused(self) -> bool:
        """Whether nothing can be learnt from these data: no further stage is asked."""
        return any(finding.severity == "refused" for finding in self.findings)

    @cached_property
    def motion(self) -> Motion | None:
        """The motion of the accepted samples, None if slider and tip have no common time."""
        return motion_of(self.recording, self.rig)

    @property
    def motion_as_recorded(self) -> Motion | None:
        """The motion of all samples, the same where all are accepted."""
        if self.recorded is None or self.recorded is self.recording:
            return self.motion
        return motion_of(self.recorded, self.rig)

    def has(self, *names: str) -> bool:
        """Whether one of these was found."""
        return any(finding.name in names for finding in self.findings)

    def found(
        self, more: Iterable[Finding | None], recording: Recording | None = None, *, synchronous: bool = False
    ) -> Evidence:
        """With further findings; recording: accepted from here on, as before if None; synchronous: shown by them."""
        findings = (*self.findings, *(finding for finding in more if finding is not None))
        after = replace(
            self, findings=findings, recording=recording or self.recording, synchronous=self.synchronous or synchronous
        )
        if after.recording is self.recording and "motion" in self.__dict__:
            after.__dict__["motion"] = self.motion  # of the same samples: it need not be found again
        return after
