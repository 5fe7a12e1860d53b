# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a reader has to say about a recording, and which of it is about lost data."""

from __future__ import annotations


class Notes(list[str]):
    """Sentences, each once. losses: those of them about data that are missing or cannot be read."""

    def __init__(self) -> None:
        super().__init__()
        self.losses: list[str] = []

    def add(self, text: str, *, lost: bool = False) -> None:
        """Add a sentence, if it is new. lost: data are missing for it."""
        if text in self:
            return
        self.append(text)
        if lost:
            self.losses.append(text)

    def add_all(self, other: Notes) -> None:
        """Add the sentences of others."""
        for text in other:
            self.add(text, lost=text in other.losses)
