# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Forward selection: screen all candidates, select the best, subtract it, screen again; three terms at most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.evidence.drivers import CONSTANT, LOCAL
from push_predictor.residuals.evidence.inputs_basis import InputsBasis
from push_predictor.residuals.evidence.residualizer import ResidualBlocks
from push_predictor.residuals.evidence.standardised import FEWEST_BLOCKS, Evidence
from push_predictor.residuals.selection.baseline import Baseline, difference, raised
from push_predictor.residuals.selection.cross_validation import fit
from push_predictor.residuals.selection.screening import Scores, Screened, raw_scores, screen, unit_scores
from push_predictor.residuals.selection.term_choice import SelectedTerm, TermChoice
from push_predictor.types import Array

MOST_TERMS = 3
OWN = 2  # rank of effects in the base's own inputs, after those of a covariate (0) and those local to a push (1)
CHANGED = 0.05  # p from which a constant effect that an analytical base lacks is a change since training
HOPELESS = 0.5  # p from which nothing can be significant
OBVIOUS, SURE = 30.0, 3.5  # nats, cross-validated, and in standard errors: a few pushes far off gain as much
UNKNOWN = (None, CONSTANT)  # what a polynomial leaves of an earlier unknown effect, rather than an effect
DWARFED = 12.0  # ratio of gains from which an effect in the base's own inputs is selected first


@dataclass(frozen=True, eq=False)
class SearchResult:
    """Terms in the order of their selection; the first and the last screen of all candidates.

    unexplained (n, 3): the standardised residuals minus the terms.
    """

    terms: tuple[SelectedTerm, ...]
    candidates: tuple[Candidate, ...]
    first: Screened
    last: Screened
    unexplained: Array


def search(
    evidence: Evidence,
    candidates: Sequence[Candidate],
    inputs: InputsBasis,
    alpha: float,
    seed: int = 0,
    *,
    baseline: Baseline | None = None,
    terms: Sequence[SelectedTerm] = (),
    unexplained: Array | None = None,
) -> SearchResult:
    """Search the residuals for terms; alpha is the probability of any term where there is no effect.

    inputs: the model's inputs, which are regressed out. baseline: cross-validated training residuals, against which
    effects in a learnt base's own inputs are judged; without it they are judged against zero. terms: found
    before, which leave `unexplained` (n, 3).
    """
    selection = ForwardSelection(TermChoice(evidence, tuple(candidates), inputs, seed), alpha, baseline)
    z, first = evidence.z if unexplained is None else unexplained, None
    terms, most = list(terms), MOST_TERMS + len(terms)
    while True:
        screened = selection.screened(z)
        first = first or screened
        found = [k for k in range(len(candidates)) if screened.p_value[k] <= alpha]
        if not found or len(terms) == most:
            return SearchResult(tuple(terms), tuple(candidates), first, screened, z)
        found = selection.first_to_select(found, screened, z)
        used = {term.best.covariate for term in terms}
        term = selection.choice.term(found, screened, z, used)
        if term.best.label == UNKNOWN and any(earlier.mechanism is None for earlier in terms):
            return SearchResult(tuple(terms), tuple(candidates), first, screened, z)
        terms.append(replace(term, since_training=selection.since_training(term.best, z)))
        z = selection.subtracted(terms[-1], z)


@dataclass(frozen=True, eq=False)
class ForwardSelection:
    """One search: the choice of a term, the family-wise level, and the reference in training."""

    choice: TermChoice
    alpha: float
    baseline: Baseline | None

    @cached_property
    def training(self) -> dict[int, tuple[Scores, Array]]:
        """Scores in training, by id of the candidates that are judged against it."""
        if self.baseline is None:
            return {}
        return {id(c): self.baseline.scores(c) for c in self.choice.candidates if self.baseline.judges(c)}

    def screened(self, z: Array) -> Screened:
        """Screen all candidates on residuals z (n, 3).

        The bootstrap takes the residuals for noise. With few blocks an obvious effect would drown in itself, so the
        noise is then what the strongest leaves of them.
        """
        first = self._screened(z, z)
        few = int(self.choice.evidence.block.max()) + 1 < FEWEST_BLOCKS
        if not few or not self.alpha < first.p_value.min() <= HOPELESS:
            return first
        judged = self.choice.with_gains(first, z)
        obvious = [k for k, j in judged.items() if j.gain >= max(OBVIOUS, SURE * j.error)]
        if not obvious:
            return first
        strongest = max((judged[k] for k in obvious), key=lambda j: j.gain).candidate
        again, p_value = self._screened(z, self._without(strongest, z)), first.p_value.copy()
        p_value[obvious] = np.minimum(p_value[obvious], again.p_value[obvious])
        return replace(first, p_value=p_value)

    def _without(self, candidate: Candidate, z: Array) -> Array:
        """The residuals minus the shrunk fit of a candidate."""
        residualizer = self.choice.residualizers[candidate.kind]
        columns = residualizer(candidate.columns)
        return np.asarray(z - columns @ fit(columns, residualizer(z), self.choice.evidence.block))

    def _screened(self, z: Array, noise: Array) -> Screened:
        candidates, block = self.choice.candidates, self.choice.evidence.block
        blocks = {kind: out.blocks(z, block, noise) for kind, out in self.choice.residualizers.items()}
        # Many candidates share one array of nuisance columns: each is projected off only once.
        groups = {(c.kind, id(c.nuisance)): c for c in candidates}
        apart = {key: blocks[c.kind].orthogonal_to(c.nuisance) for key, c in groups.items()}
        each = [apart[c.kind, id(c.nuisance)] for c in candidates]
        screened = screen([self._scores(c, own) for c, own in zip(candidates, each, strict=True)], self.choice.seed)
        return self._against_training(screened, each)

    def first_to_select(self, found: Sequence[int], screened: Screened, z: Array) -> list[int]:
        """Those of the candidates found that are selected first: effects in the base's own inputs come last.

        A refit of the base learns these. They come first if they are so much larger that another effect found may be
        their second order.
        """
        by_rank: dict[int, list[int]] = {}
        for k in found:
            by_rank.setdefault(self._rank(self.choice.candidates[k]), []).append(k)
        least = min(by_rank)
        if least == OWN or OWN not in by_rank:
            return by_rank[least]
        gains = [self.choice.best_gain(by_rank[rank], screened, z) for rank in (least, OWN)]
        return by_rank[OWN] if gains[1] > DWARFED * max(gains[0], 0.0) else by_rank[least]

    def subtracted(self, term: SelectedTerm, z: Array) -> Array:
        """The residuals minus a term; for a learnt base also minus its constant part, which a refit learns."""
        residual = z - term.shift
        own = any(c.label == (term.best.mechanism, CONSTANT) for c in self.choice.candidates)
        if not self.choice.inputs.absorbs or term.best.kind == "constant" or not own:
            return residual
        constant = term.best.response
        return residual - constant @ fit(constant, residual)

    def since_training(self, candidate: Candidate, z: Array) -> bool:
        """Whether an effect that depends on nothing differs from training; for a learnt base every one does."""
        if self.baseline is None or candidate.covariate != CONSTANT:
            return False
        if self.choice.inputs.learnt:
            return True
        residualizer = self.choice.residualizers[candidate.kind]
        blocks = residualizer.blocks(z, self.choice.evidence.block).orthogonal_to(candidate.nuisance)
        change = difference(self._raw(candidate, blocks), self.baseline.scores(candidate))
        return bool(screen([change], self.choice.seed).p_value[0] <= CHANGED)

    def _against_training(self, screened: Screened, blocks: Sequence[ResidualBlocks]) -> Screened:
        """Raise p of effects of fixed rig properties to that of their difference from training, all at once."""
        baseline, candidates = self.baseline, self.choice.candidates
        if baseline is None:
            return screened
        found = [k for k, c in enumerate(candidates) if screened.p_value[k] <= self.alpha and baseline.compares(c)]
        changes = {k: difference(self._raw(candidates[k], blocks[k]), baseline.scores(candidates[k])) for k in found}
        compared = raised(screened, changes, self.choice.seed)
        return replace(compared, unchanged=tuple(k for k in found if compared.p_value[k] > self.alpha))

    def _scores(self, candidate: Candidate, blocks: ResidualBlocks) -> Scores:
        """Scores of these blocks, then of those in training (zero if the candidate is not judged against it)."""
        raw = self._raw(candidate, blocks)
        if id(candidate) in self.training:
            return difference(raw, self.training[id(candidate)])
        return unit_scores(*raw).padded(next((len(scores.rows) for scores, _ in self.training.values()), 0))

    def _raw(self, candidate: Candidate, blocks: ResidualBlocks) -> tuple[Scores, Array]:
        return raw_scores(blocks, self.choice.residualizers[candidate.kind](candidate.columns))

    def _rank(self, candidate: Candidate) -> int:
        if candidate.covariate in LOCAL:
            return 1
        return OWN if self.choice.inputs.absorbs and self.choice.own(candidate) else 0
