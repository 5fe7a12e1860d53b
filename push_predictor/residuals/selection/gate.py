# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The gate: whether anything in the residuals is more than chance, judged over all candidates at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import get_args

from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, Kind, controls_for
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.selection.baseline import Baseline, difference, raised
from push_predictor.residuals.selection.screening import Columns, Scores, Screened, screen
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class Gate:
    """Screens candidates on residuals of these windows.

    inputs: the model's inputs, which are regressed out. baseline: cross-validated training residuals, against which
    effects in a learnt base's own inputs are judged; without it they are judged against zero.
    """

    evidence: Evidence
    candidates: tuple[Candidate, ...]
    inputs: InputsBasis
    alpha: float
    seed: int = 0
    baseline: Baseline | None = None

    def screened(self, z: Array, noise: Array | None = None) -> Screened:
        """Statistic and family-wise p of all candidates on residuals z (n, 3); noise (n, 3): that of them, z if None.

        An effect that a fixed property of the rig may have caused in training, too, has the p of its difference.
        """
        blocks = {kind: out.blocks(z, self.evidence.block, noise) for kind, out in self._residualizers.items()}
        # Many candidates share one array of nuisance columns: each is projected off only once.
        groups = {(c.kind, id(c.nuisance)): c for c in self.candidates}
        apart = {key: blocks[c.kind].orthogonal_to(c.nuisance) for key, c in groups.items()}
        each = [
            columns.scores(apart[c.kind, id(c.nuisance)])
            for c, columns in zip(self.candidates, self._columns, strict=True)
        ]
        return self._against_training(screen([self._unit(k, own) for k, own in enumerate(each)], self.seed), each)

    @cached_property
    def _residualizers(self) -> dict[Kind, Residualizer]:
        return {kind: Residualizer(controls_for(kind, self.inputs)) for kind in get_args(Kind)}

    @cached_property
    def _columns(self) -> list[Columns]:
        """Those of all candidates, on any residuals."""
        return [Columns(self._residualizers[c.kind](c.columns)) for c in self.candidates]

    @cached_property
    def _training(self) -> dict[int, tuple[Scores, Array]]:
        """Scores in training, by number of the candidates that are always judged against it."""
        if self.baseline is None:
            return {}
        return {k: self.baseline.scores(c) for k, c in enumerate(self.candidates) if self.baseline.judges(c)}

    def _unit(self, k: int, scores: Scores) -> Scores:
        """Scores of a candidate in units of chance, then of those in training (zero if it is not judged against it)."""
        if k in self._training:
            return difference((scores, self._columns[k].information), self._training[k])
        there = next((len(scores.rows) for scores, _ in self._training.values()), 0)
        return scores.turned(self._columns[k].unit).padded(there)

    def _against_training(self, screened: Screened, scores: Sequence[Scores]) -> Screened:
        """Raise p of effects of fixed rig properties to that of their difference from training, all at once."""
        baseline, candidates = self.baseline, self.candidates
        if baseline is None:
            return screened
        found = [k for k, c in enumerate(candidates) if screened.p_value[k] <= self.alpha and baseline.compares(c)]
        changes = {
            k: difference((scores[k], self._columns[k].information), baseline.scores(candidates[k])) for k in found
        }
        compared = raised(screened, changes, self.seed)
        return replace(compared, unchanged=tuple(k for k in found if compared.p_value[k] > self.alpha))
