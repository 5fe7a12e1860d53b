# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The input of every section: plan, data, work queue, folder for pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from push_predictor_paper.data.corpus import Corpus, PushSet, simulated_corpus
from push_predictor_paper.data.measured import measured_corpora
from push_predictor_paper.data.repetitions import RepeatedGrid, repeated_grid
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

    def size_of(self, pushes: PushSet) -> int:
        """Training windows of a model that holds nothing back: the plan's size, or all that the set has."""
        return min(self.plan.size, len(pushes.table))

    def file(self, name: str, corpus: Corpus, *more: str) -> Path:
        """The file of a picture of a corpus."""
        return self.out / f"{'_'.join((name, *more, corpus.origin))}_{self.corpora.index(corpus)}.png"


def gather(plan: Plan, work: Work, out: Path, measured: Path | None, keep: Path | None) -> Study:
    """Simulate the recordings, find their windows, import the measured sets."""
    simulated = simulated_corpus(plan, work, keep)
    reference = simulated.reference[1]
    again = {s: plan.repetitions if s == reference else plan.other_repetitions for s in plan.surfaces}
    grids = {surface: repeated_grid(plan, work, surface, count, keep) for surface, count in again.items()}
    found = () if measured is None else measured_corpora(measured, work, work.folder / "measured")
    return Study(plan, work, out, simulated, found, grids)
