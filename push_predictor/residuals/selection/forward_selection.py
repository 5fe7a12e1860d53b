"""The search: screen all candidates, take the best, take it out, look again; at most three."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.residuals.candidates.enumeration import Candidate
from push_predictor.residuals.evidence.drivers import CONSTANT, HEADINGS, LOCAL
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, Kind, inputs_of
from push_predictor.residuals.evidence.residualizer import ResidualBlocks, Residualizer
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.selection.baseline import Baseline, difference
from push_predictor.residuals.selection.basis_choice import best_form
from push_predictor.residuals.selection.cross_validation import Judged, fit, judge
from push_predictor.residuals.selection.naming import MOST_LEFT, Case, Naming, leaves_over, open_rivals, plausible
from push_predictor.residuals.selection.screening import Scores, Screened, raw_scores, screen, unit_scores
from push_predictor.types import Array

MOST_TERMS = 3
OWN = 2  # rank of what lies in the base's own inputs, after what is driven (0) and what is local to a push (1)
DWARFED = 12.0  # ratio of gains; what grows from nothing is at most ten times as large in the mean as about it
NOT_GROWING = ("edge", *HEADINGS, *LOCAL)  # an effect that stands in body or world does not grow with them
MOST_JUDGED = 60  # of the significant candidates, those with the largest statistics
MOST_FORMED = 12  # of the labels, those that are tried in every form
MOST_NAMED = 5  # mechanisms along the driver, best first, that are tried as its name


@dataclass(frozen=True, eq=False)
class Term:
    """One effect found: the best candidate, all rivals that stay open (the best first), family-wise p, coefficients.

    share: of the residual's sum of squares, in units of the prediction, that it explains. naming: what it is called.
    """

    best: Candidate
    rivals: tuple[Judged, ...]
    p_value: float
    coefficients: Array
    share: float
    naming: Naming


@dataclass(frozen=True, eq=False)
class Search:
    """What the search found, what is driven first, then strongest first; first and last screen of all candidates.

    left (n, 3): the standardised residuals less what was found.
    """

    terms: tuple[Term, ...]
    candidates: tuple[Candidate, ...]
    first: Screened
    last: Screened
    left: Array


def search(
    evidence: Evidence,
    candidates: Sequence[Candidate],
    basis: InputsBasis,
    alpha: float,
    seed: int = 0,
    *,
    baseline: Baseline | None = None,
    most_terms: int = MOST_TERMS,
) -> Search:
    """Search the residuals of these windows for candidates that chance exceeds anywhere with probability alpha.

    basis: the model's inputs, taken out of residual and candidates. baseline: what a learnt base leaves over in
    training, against which effects in its own inputs are judged; without it they are judged against zero.
    """
    hunt = _ForwardSelection(evidence, tuple(candidates), basis, seed, alpha, baseline, _training(candidates, baseline))
    z, first = evidence.z, None
    terms: list[Term] = []
    while True:
        screened = hunt.screened(z)
        first = first or screened
        found = [k for k in range(len(candidates)) if screened.p_value[k] <= alpha]
        if not found or len(terms) == most_terms:
            return Search(tuple(terms), tuple(candidates), first, screened, z)
        found = hunt.stage(found, screened, z)
        terms.append(hunt.term(found, screened, z, {term.best.covariate for term in terms}))
        z = hunt.taken_out(terms[-1], z)


def _training(candidates: Sequence[Candidate], baseline: Baseline | None) -> dict[int, tuple[Scores, Array]]:
    if baseline is None:
        return {}
    return {id(c): baseline.scores(c) for c in candidates if baseline.applies(c)}


@dataclass(frozen=True, eq=False)
class _ForwardSelection:
    """What all rounds of a search share. training: scores there of the candidates that are judged against it."""

    evidence: Evidence
    candidates: tuple[Candidate, ...]
    basis: InputsBasis
    seed: int
    alpha: float
    baseline: Baseline | None
    training: dict[int, tuple[Scores, Array]]

    @cached_property
    def outs(self) -> dict[Kind, Residualizer]:
        """What takes the inputs out, by kind of candidate."""
        return {kind: Residualizer(inputs_of(kind, self.basis)) for kind in get_args(Kind)}

    def screened(self, z: Array) -> Screened:
        """All candidates on residuals z."""
        lefts = {kind: out.left(z, self.evidence.block) for kind, out in self.outs.items()}
        # Of the candidate's kind, and less what goes out of the candidate: the same array for many of them.
        groups = {(c.kind, id(c.beside)): c for c in self.candidates}
        apart = {key: lefts[c.kind].apart(c.beside) for key, c in groups.items()}
        each = [apart[c.kind, id(c.beside)] for c in self.candidates]
        screened = screen([self._scores(c, left) for c, left in zip(self.candidates, each, strict=True)], self.seed)
        return self._news(screened, each)

    def _news(self, screened: Screened, lefts: Sequence[ResidualBlocks]) -> Screened:
        """Where what stands in the rig was found: whether it is other than in training, all of these at once."""
        found = [k for k, c in enumerate(self.candidates) if screened.p_value[k] <= self.alpha and self._stands(c)]
        if not found or self.baseline is None:
            return screened
        changed = []
        for k in found:
            c = self.candidates[k]
            raw = raw_scores(lefts[k], self.outs[c.kind](c.columns))
            changed.append(difference(raw, self.baseline.scores(c)))
        p_value = screened.p_value.copy()
        p_value[found] = np.maximum(p_value[found], screen(changed, self.seed).p_value)
        return replace(screened, p_value=p_value, standing=tuple(k for k in found if p_value[k] > self.alpha))

    def _stands(self, candidate: Candidate) -> bool:
        return self.baseline is not None and self.baseline.stands(candidate)

    def _scores(self, candidate: Candidate, left: ResidualBlocks) -> Scores:
        """Scores of the blocks of these windows, then of the training windows (zero if not judged against them)."""
        raw = raw_scores(left, self.outs[candidate.kind](candidate.columns))
        if id(candidate) in self.training:
            return difference(raw, self.training[id(candidate)])
        return unit_scores(*raw).padded(next((len(there.rows) for there, _ in self.training.values()), 0))

    def stage(self, found: list[int], screened: Screened, z: Array) -> list[int]:
        """Of what was found, that which goes first: a refit of the base makes up for what lies in its own inputs.

        Unless that is so much larger that what seems driven will be what its first order leaves over.
        """
        ranks = [self._rank(self.candidates[k]) for k in found]
        by_rank = {rank: [k for k, r in zip(found, ranks, strict=True) if r == rank] for rank in sorted(set(ranks))}
        first = by_rank[min(ranks)]
        if min(ranks) == OWN or OWN not in by_rank:
            return first
        gains = [self._gain_of_best(each, screened, z) for each in (first, by_rank[OWN])]
        return by_rank[OWN] if gains[1] > DWARFED * max(gains[0], 0.0) else first

    def _gain_of_best(self, found: list[int], screened: Screened, z: Array) -> float:
        best = sorted(found, key=lambda k: -screened.statistic[k])[:MOST_NAMED]
        return max(self._judge([self.candidates[k]], self.candidates[k].kind, z)[0].gain for k in best)

    def term(self, found: list[int], screened: Screened, z: Array, used: set[str]) -> Term:
        """The best of what was found, named. used: drivers of earlier terms, preferred where they do as well."""
        chosen = self._not_constant(sorted(found, key=lambda k: -screened.statistic[k])[:MOST_JUDGED])
        growing = self._growing(found)
        judged = self._formed([_whole(self.candidates[k], growing) for k in chosen], z)
        open_ = open_rivals(judged[0], _one_each(judged[1:], judged[0], "covariate"), self._case(judged[0], z))
        driver = next((j for j in open_ if j.candidate.covariate in used), judged[0]).candidate.covariate
        best, naming = self._named(judged, driver, z, growing)
        drivers = tuple(dict.fromkeys([driver, *(j.candidate.covariate for j in open_)]))
        labels = {j.candidate.label for j in judged}
        p_value = min(float(screened.p_value[k]) for k in chosen if self.candidates[k].label in labels
                      and self.candidates[k].covariate == driver)  # fmt: skip
        return self._term(best, open_, p_value, replace(naming, drivers=drivers), z)

    def taken_out(self, term: Term, z: Array) -> Array:
        """The residuals less a term; for a learnt base also less what is constant of it: the refit makes up for it."""
        left = z - term.best.plain @ term.coefficients
        own = any(c.label == (term.best.mechanism, CONSTANT) for c in self.candidates)
        if not self.basis.learnt or term.best.kind == "constant" or not own:
            return left
        constant = term.best.response
        return left - constant @ fit(constant, left)

    def _growing(self, found: list[int]) -> set[str]:
        """Mechanisms whose constant effect, which no base can have, was found and found to be driven by something."""
        labels = [(self.candidates[k].mechanism, self.candidates[k]) for k in found]
        constant = {name for name, c in labels if name is not None and _is_constant(c)}
        return constant & {name for name, c in labels if name is not None and c.covariate not in NOT_GROWING}

    def _not_constant(self, found: list[int]) -> list[int]:
        """Without the constant effects of mechanisms that something drives: they are part of what is driven."""
        growing = self._growing(found)
        return [k for k in found if not (_is_constant(c := self.candidates[k]) and c.mechanism in growing)]

    def _rank(self, candidate: Candidate) -> int:
        if candidate.covariate in LOCAL:
            return 1
        own = candidate.kind == "constant" or (candidate.kind == "speed" and self.basis.knows_speed)
        return OWN if own else 0

    def _case(self, judged: Judged, z: Array) -> Case:
        return Case(z, inputs_of(judged.candidate.kind, self.basis), self.evidence.block)

    def _formed(self, candidates: list[Candidate], z: Array) -> list[Judged]:
        """The candidates by their gain, the best forms of the best of them; each label once."""
        kinds = {c.kind for c in candidates}
        judged = [j for kind in kinds for j in self._judge([c for c in candidates if c.kind == kind], kind, z)]
        first = _one_each(sorted(judged, key=lambda j: -j.gain), None, "label")[:MOST_FORMED]
        return sorted((self._in_best_form(j.candidate, z) for j in first), key=lambda j: -j.gain)

    def _judge(self, candidates: list[Candidate], kind: Kind, z: Array) -> list[Judged]:
        return judge(candidates, z, inputs_of(kind, self.basis), self.evidence.block)

    def _in_best_form(self, candidate: Candidate, z: Array) -> Judged:
        case = inputs_of(candidate.kind, self.basis)
        return best_form(candidate, self.evidence.table, z, case, self.evidence.block)

    def _named(self, judged: list[Judged], driver: str, z: Array, growing: set[str]) -> tuple[Judged, Naming]:
        """The best mechanism along a driver, if any fits; else the generic fall-back."""
        along = [_whole(c, growing) for c in _labels(self.candidates) if c.covariate == driver]
        formed = {j.candidate.label: j for j in judged}
        by_gain = sorted((formed.get(c.label) or self._in_best_form(c, z) for c in along), key=lambda j: -j.gain)
        known = [
            j
            for j in by_gain
            if j.candidate.mechanism is not None and j.gain > 0.0 and plausible(j.candidate, self._case(j, z))
        ]
        generics = self._generics(driver, known[0].candidate.form if known else None, z)
        left = {id(j): self._left_over(j, generics, z) for j in known[:MOST_NAMED]}
        fitting = [j for j in known[:MOST_NAMED] if left[id(j)] <= MOST_LEFT]
        if not fitting and generics:
            best = max((self._in_best_form(g, z) for g in generics), key=lambda j: j.gain)
            return best, Naming((driver,), (None,), False, min(left.values(), default=1.0))
        fitting = fitting or known[:1] or by_gain[:1]  # the last two where the fall-back is not tried
        best = fitting[0]
        mechanisms = open_rivals(best, fitting[1:], self._case(best, z), self.seed)
        return best, Naming((driver,), tuple(j.candidate.mechanism for j in mechanisms), True, left.get(id(best), 0.0))

    def _left_over(self, mechanism: Judged, generics: list[Candidate], z: Array) -> float:
        case = self._case(mechanism, z)
        return max((leaves_over(mechanism, generic, case, self.seed) for generic in generics), default=0.0)

    def _generics(self, driver: str, form: DriverBasis | None, z: Array) -> list[Candidate]:
        """The fall-back along a driver: in the form of the mechanism, or in all screening forms of the driver."""
        same = [c for c in self.candidates if c.mechanism is None and c.covariate == driver]
        if same and form is not None and form.drivers:
            return [replace(same[0], form=form, values=form.values(self.evidence.table.covariates, len(z)))]
        return same or [c for c in self.candidates if c.mechanism is None and c.kind == "constant"]

    def _term(self, best: Judged, open_: list[Judged], p_value: float, naming: Naming, z: Array) -> Term:
        out = self.outs[best.candidate.kind]
        left, flat = out(z), out(best.candidate.columns)
        coefficients = fit(flat, left)
        share = 1.0 - float(np.sum((left - flat @ coefficients) ** 2) / np.sum(left**2))
        others = tuple(j for j in open_ if j.candidate.label != best.candidate.label)
        return Term(best.candidate, (best, *others), p_value, coefficients, share, naming)


def _is_constant(candidate: Candidate) -> bool:
    return candidate.kind == "driven" and candidate.form.name == "constant"


def _whole(candidate: Candidate, growing: set[str]) -> Candidate:
    """A candidate of a mechanism that grows with what it does without the driver in it."""
    driven = candidate.mechanism in growing and not _is_constant(candidate)
    return replace(candidate, beside=candidate.whole) if driven else candidate


def _labels(candidates: Sequence[Candidate]) -> list[Candidate]:
    return list({c.label: c for c in reversed(candidates)}.values())


def _one_each(judged: Sequence[Judged], best: Judged | None, what: Literal["covariate", "label"]) -> list[Judged]:
    """The first of each driver (or label), without that of the best."""
    first: dict[object, Judged] = {}
    for each in judged:
        first.setdefault(getattr(each.candidate, what), each)
    return [j for key, j in first.items() if best is None or key != getattr(best.candidate, what)]
