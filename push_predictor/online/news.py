# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Which of the things that are present deserve a line in the log."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Mapping


class News:
    """What has lasted for two looks is news once, and again after it has changed or been away.

    at_once: without waiting for the second look.
    """

    def __init__(self, at_once: bool = False) -> None:
        self._at_once = at_once
        self._seen: Mapping[str, Hashable] = {}
        self._told: dict[str, Hashable] = {}

    def gone(self, present: Collection[str]) -> list[str]:
        """The keys that were news and are no longer present."""
        return [key for key in self._told if key not in present]

    def of(self, present: Mapping[str, Hashable]) -> list[str]:
        """The keys of the news; a value tells in what state a thing is."""
        before = present if self._at_once else self._seen
        lasting = [key for key, state in present.items() if key in before and before[key] == state]
        news = [key for key in lasting if key not in self._told or self._told[key] != present[key]]
        self._seen = dict(present)
        self._told = {key: state for key, state in self._told.items() if key in present}
        self._told |= {key: present[key] for key in news}
        return news
