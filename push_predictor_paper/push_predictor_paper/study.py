# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
