"""The topic names of a recording's streams."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TopicNames:
    """Topics of a recording (docs/reference/recordings.md); a leading slash makes no difference."""

    slider: str = "slider/pose"
    pusher: str = "pusher/pose"
    wrench: str = "pusher/wrench"
