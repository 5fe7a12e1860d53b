# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The input of every claim: plan, data, work queue, folder for pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.data.repetitions import RepeatedGrid
from push_predictor_paper.plan import Plan
from push_predictor_paper.work import Work


@dataclass(frozen=True, eq=False)
class Study:
    """Plan, data and tools. simulated: the training recordings; measured: one corpus per source; grids: by surface."""

    plan: Plan
    work: Work
    out: Path
    simulated: Corpus
    measured: tuple[Corpus, ...]
    grids: Mapping[str, RepeatedGrid]

    @property
    def corpora(self) -> tuple[Corpus, ...]:
        """All corpora, the simulated one first."""
        return (self.simulated, *self.measured)

    @property
    def reference_grid(self) -> RepeatedGrid:
        """The grid on the reference surface."""
        return self.grids[self.simulated.reference[1]]
