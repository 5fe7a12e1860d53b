# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The search for effects on the motion: a gate, then moves that add, exchange and drop terms of one joint fit.

A term is a mechanism, a covariate and a form. Without what passes the gate (gate.py) there is no effect. Every move is
judged by what the joint fit gains on blocks of pushes that it was not fitted to (candidates/joint_fit.py). A term is
added, or kept, if it gains more than the standard error of that gain, and a further one also as much as a step of the
ladder of mechanics. An exchange puts another in place of one where that gains more: it undoes a choice that later terms
made wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.mechanics.ladder import least_gain
from push_predictor.residuals.candidates.candidate import Candidate, candidate
from push_predictor.residuals.candidates.enumeration import constant_refinements
from push_predictor.residuals.candidates.joint_fit import Fit, FitRows, best_place, fitted, standard_error
from push_predictor.residuals.selection.forms import forms_of
from push_predictor.residuals.selection.gate import Gate
from push_predictor.residuals.selection.naming import Naming, Trial, chosen_of, naming_of
from push_predictor.residuals.selection.screening import Screened
from push_predictor.types import Array

MOST_ADDITIONS = 6
MOST_MECHANISMS = 4  # of those that the gate let pass, with the largest statistics
MOST_EXACT = 6  # labels that are fitted exactly, by their gain to first order
MOST_MOVES = 3  # of a step's place
MOST_ROUNDS = 6  # of moves after an addition
Label = tuple[str | None, str]  # mechanism (None: unknown) and covariate
Key = tuple[str | None, str, DriverBasis]


@dataclass(frozen=True, eq=False)
class Term:
    """A chosen term. p_value: family-wise. gain: in log density over the fit of the others, nats."""

    best: Candidate
    p_value: float
    gain: float
    naming: Naming

    @property
    def mechanism(self) -> str | None:
        """The mechanism that the effect is named after; None if none fits, even if `best` has one that comes close."""
        return self.best.mechanism if self.naming.known else None


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The terms, the largest gain first, and their joint fit; the first and the last screen of all candidates.

    unexplained (n, 3): the standardised residuals minus the terms.
    """

    terms: tuple[Term, ...]
    fit: Fit
    candidates: tuple[Candidate, ...]
    first: Screened
    last: Screened
    unexplained: Array


def search(gate: Gate, rows: FitRows) -> SearchResult:
    """Search these windows for terms; gate.alpha is the probability of any term where there is no effect."""
    return _Search(gate, rows).found()


@dataclass(eq=False)
class _Search:
    """passed: p of what the gate let pass, by label, in the order of their statistics. known: fits by their terms.

    unchanged: labels that training shows to the same degree.
    """

    gate: Gate
    rows: FitRows
    passed: dict[Label, float] = field(default_factory=dict)
    known: dict[tuple[Key, ...], Fit] = field(default_factory=dict)
    unchanged: set[Label] = field(default_factory=set)

    def found(self) -> SearchResult:
        chosen: list[Candidate] = []
        fit = self._fit(chosen)
        first = screened = self.gate.screened(self._unexplained(fit))
        for _ in range(MOST_ADDITIONS):
            if not self._let_pass(screened):
                break
            added = self._best(fit, chosen)
            if added is None or not self._worthwhile(added.fit, fit, bool(chosen)):
                break
            chosen, fit = self._improved([*chosen, added.candidate], added.fit)
            screened = self.gate.screened(self._unexplained(fit))
        terms = [self._named(chosen[:k] + chosen[k + 1 :], chosen[k]) for k in range(len(chosen))]
        terms = list({term.best.label: term for term in sorted(terms, key=lambda term: term.gain)}.values())[::-1]
        fit = self._fit([term.best for term in terms], fit)
        return SearchResult(tuple(terms), fit, self.gate.candidates, first, screened, self._unexplained(fit))

    # --- moves -------------------------------------------------------------------------------------------------------

    def _worthwhile(self, after: Fit, before: Fit, further: bool) -> bool:
        """Whether an addition gains more than its error; a further one as much as a step of the ladder, too."""
        size = len(after.coefficients) - len(before.coefficients)
        least = least_gain(len(self.rows.evidence.table.pushes)) * size if further else 0.0
        gains = after.scores - before.scores
        return bool(gains.sum() > max(least, standard_error(gains)))

    def _improved(self, chosen: list[Candidate], fit: Fit) -> tuple[list[Candidate], Fit]:
        """Drops and exchanges until none helps; the first term alone was the best of all."""
        for _ in range(MOST_ROUNDS):
            moved = len(chosen) > 1 and (self._dropped(chosen, fit) or self._exchanged(chosen, fit))
            if not moved:
                break
            chosen, fit = moved
        return chosen, fit

    def _dropped(self, chosen: list[Candidate], fit: Fit) -> tuple[list[Candidate], Fit] | None:
        for k in range(len(chosen)):
            others = chosen[:k] + chosen[k + 1 :]
            without = self._fit(others, fit)
            if not self._worthwhile(fit, without, True):
                return others, without
        return None

    def _exchanged(self, chosen: list[Candidate], fit: Fit) -> tuple[list[Candidate], Fit] | None:
        for k in range(len(chosen)):
            others = chosen[:k] + chosen[k + 1 :]
            now, base = Trial(chosen[k], self._fit([*others, chosen[k]], fit)), self._fit(others, fit)
            best = chosen_of([now, *(t for t in self._tried(base, others) if t.candidate.mechanism is not None)])
            if not best.candidate.same_as(chosen[k]):
                return [*others, best.candidate], best.fit
        return None

    def _named(self, others: list[Candidate], c: Candidate) -> Term:
        base, chosen = self._fit(others), Trial(c, self._fit([*others, c]))
        tried = [t for t in self._tried(base, others) if not t.candidate.same_as(c)]
        naming = naming_of(chosen, tried, base)
        generic = max((t for t in tried if t.candidate.mechanism is None), key=lambda t: t.gain, default=chosen)
        if not naming.known and generic.gain > chosen.gain:
            chosen = generic
        gain = chosen.gain - float(base.scores.sum())
        return Term(chosen.candidate, self._p_value(c), gain, naming)

    # --- proposals ---------------------------------------------------------------------------------------------------

    def _best(self, base: Fit, others: Sequence[Candidate]) -> Trial | None:
        """What is best added to a fit of the others; a mechanism rather than the generic polynomial."""
        tried = self._tried(base, others)
        known = [t for t in tried if t.candidate.mechanism is not None and t.gain > base.scores.sum()]
        if not tried:
            return None
        best = chosen_of(known or tried)
        return max([best, *self._in_other_forms(best.candidate, base, others)], key=lambda t: t.gain)

    def _in_other_forms(self, c: Candidate, base: Fit, others: Sequence[Candidate]) -> list[Trial]:
        """The candidate in as simple forms of other kinds, fitted exactly: to first order these may seem as good."""
        if c.basis.is_constant:
            return []
        forms = {basis.name: basis for basis in forms_of(c.covariate, self.rows.evidence.table) if not basis.offset}
        tried = [
            candidate(self.rows.evidence, *c.label, basis) for basis in forms.values() if basis.name != c.basis.name
        ]
        return [self._fitted_with(others, t, base) for t in tried if t.plain.shape[2] <= c.plain.shape[2]]

    def _tried(self, base: Fit, others: Sequence[Candidate]) -> list[Trial]:
        """The labels that gain most to first order, each in its best form, fitted exactly."""
        # What an effect leaves along its covariate is a question of its name, and a constant part one of its form.
        taken = {
            label
            for c in others
            for label in (c.label, (None, c.covariate), (c.mechanism, self._constants.get(c.mechanism)))
        }
        each = [self._in_best_form(base, *label) for label in self._proposed() if label not in taken]
        return [self._fitted_with(others, c, base) for c in _fitted_exactly(each)]

    def _proposed(self) -> Iterator[Label]:
        """Every mechanism that passed, constant and with every covariate: an effect that begins early looks constant.

        Of mechanics that were not fitted, all parameters may be off, and mimic each other.
        """
        names = list(dict.fromkeys(name for name, _ in self.passed))[:MOST_MECHANISMS]
        yield from (label for label in self._driven if label[0] in names and self._may_have_changed(label))
        for mechanism, covariate in self._constants.items():
            if not self.gate.inputs.learnt or any(mechanism == name for name, _ in self.passed):
                yield mechanism, covariate

    def _may_have_changed(self, label: Label) -> bool:
        return label in self.passed or label not in self.unchanged

    @cached_property
    def _driven(self) -> list[Label]:
        """Labels of the candidates that depend on a covariate."""
        return list(dict.fromkeys(c.label for c in self.gate.candidates if not c.basis.is_constant))

    @cached_property
    def _constants(self) -> dict[str | None, str]:
        """By mechanism, the covariate of its constant effect."""
        found = {c.mechanism: c.covariate for c in self.gate.candidates if c.basis.is_constant}
        return found if self.gate.inputs.learnt else {**found, **constant_refinements(self.rows.evidence)}

    def _in_best_form(self, base: Fit, mechanism: str | None, covariate: str) -> tuple[float, Candidate]:
        """The simplest form within a standard error of the best, and its gain, both to first order."""
        constant = self._constants.get(mechanism) == covariate
        forms = [DriverBasis("constant")] if constant else forms_of(covariate, self.rows.evidence.table)
        every = [candidate(self.rows.evidence, mechanism, covariate, basis) for basis in forms]
        scores = [base.with_columns(c.plain) for c in every]
        best = max(scores, key=lambda each: float(each.sum()))
        near = [k for k, each in enumerate(scores) if (best - each).sum() <= standard_error(best - each)]
        k = min(near, key=lambda k: (every[k].plain.shape[2], -scores[k].sum()))
        return float((scores[k] - base.scores).sum()), every[k]

    def _fitted_with(self, others: Sequence[Candidate], c: Candidate, base: Fit) -> Trial:
        """The candidate fitted next to others; a step is moved to where the effect of its size gains most."""
        trial = Trial(c, self._fit([*others, c], base))
        for k in range(MOST_MOVES if c.basis.name == "step" else 0):
            place = best_place(trial.fit, trial.candidate)
            moved = candidate(self.rows.evidence, *c.label, replace(c.basis, place=place))
            again = Trial(moved, self._fit([*others, moved], trial.fit))
            if k > 0 and again.gain <= trial.gain:  # the first place was only near
                break
            trial = again
        return trial

    # --- fits and gate -----------------------------------------------------------------------------------------------

    def _fit(self, candidates: Sequence[Candidate], near: Fit | None = None) -> Fit:
        """The joint fit, begun at another where that has the same effects."""
        terms = tuple((c.mechanism, c.covariate, c.basis) for c in candidates)
        if terms not in self.known:
            there = {} if near is None else {(e.mechanism, e.covariate, e.basis): e.coefficients for e in near.effects}
            self.known[terms] = fitted(self.rows, candidates, [there.get(term) for term in terms])
        return self.known[terms]

    def _unexplained(self, fit: Fit) -> Array:
        """Standardised residuals (n, 3) of all windows of the gate, minus the effects."""
        evidence = self.gate.evidence
        if not fit.effects:
            return evidence.z
        both = joint_shift(evidence.mechanics, [*evidence.effects, *fit.effects], evidence.push)
        had = joint_shift(evidence.mechanics, evidence.effects, evidence.push)
        return np.asarray(evidence.z - np.einsum("nij,nj->ni", evidence.whitener, both - had))

    def _let_pass(self, screened: Screened) -> bool:
        """Note the labels that pass, the largest statistic first; whether there are any."""
        order = np.argsort(-screened.statistic, kind="stable").tolist()
        new = [k for k in order if screened.p_value[k] <= self.gate.alpha]
        self.unchanged |= {self.gate.candidates[k].label for k in screened.unchanged}
        for k in new:
            c, p = self.gate.candidates[k], float(screened.p_value[k])
            self.passed[c.label] = min(p, self.passed.get(c.label, 1.0))
        return bool(new)

    def _p_value(self, c: Candidate) -> float:
        own = [p for label, p in self.passed.items() if c.mechanism == label[0] or c.covariate == label[1]]
        return min(own or self.passed.values())


def _fitted_exactly(each: Sequence[tuple[float, Candidate]]) -> list[Candidate]:
    """Those with the largest gains to first order, and the best of every mechanism; of generic ones the best alone."""
    ordered = [c for _, c in sorted(each, key=lambda pair: -pair[0])]
    known = [c for c in ordered if c.mechanism is not None]
    first = {c.mechanism: c for c in reversed(ordered)}
    return [*known[:MOST_EXACT], *(c for c in first.values() if not any(c is one for one in known[:MOST_EXACT]))]
