# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The search for effects on the motion: a gate, then moves that add, exchange and drop terms of one joint fit.

A term is a mechanism, a covariate and a form. Without what passes the gate (gate.py) there is no effect. Every move is
judged by what the joint fit gains on blocks of pushes that it was not fitted to (candidates/joint_fit.py). A term is
added, or kept, if it gains more than the standard error of that gain, and a further one also `least_gain` for each of
its coefficients, as parameters of the mechanics must. An exchange puts another in place of one where that gains more:
it undoes a choice that later terms made wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from push_predictor.models.effects.covariates import CUMULATIVE
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.mechanics.ladder import least_gain
from push_predictor.residuals.candidates.candidate import Candidate, candidate, constant_refinements
from push_predictor.residuals.candidates.joint_fit import Fit, FitRows, best_place, fitted, standard_error
from push_predictor.residuals.evidence.drivers import forms_of
from push_predictor.residuals.evidence.standardised import FEWEST_BLOCKS
from push_predictor.residuals.selection.gate import Gate
from push_predictor.residuals.selection.naming import Naming, Trial, chosen_of, naming_of
from push_predictor.residuals.selection.screening import Screened
from push_predictor.types import Array

MOST_ADDITIONS = 4
MOST_MECHANISMS = 4  # of those that the gate let pass, with the largest statistics
MOST_EXACT = 7  # labels that are fitted exactly, by their gain to first order
CLOSE = 0.4  # of the best gain to first order: less is not fitted exactly
MOST_MOVES = 3  # of a step's place
MOST_ROUNDS = 6  # of moves after an addition
OBVIOUS = 3.5  # standard errors of a gain: guards against a few pushes far off, which gain much and prove little
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

    formed: gains and best forms to first order. unchanged: labels that training shows to the same degree.
    """

    gate: Gate
    rows: FitRows
    passed: dict[Label, float] = field(default_factory=dict)
    known: dict[tuple[Key, ...], Fit] = field(default_factory=dict)
    formed: dict[tuple[Fit, Label], tuple[float, Candidate]] = field(default_factory=dict)
    unchanged: set[Label] = field(default_factory=set)

    def found(self) -> SearchResult:
        chosen: list[Candidate] = []
        fit = self._fit(chosen)
        first = screened = self._screened(fit, chosen)
        for _ in range(MOST_ADDITIONS):
            if not self._let_pass(screened):
                break
            added = self._best(fit, chosen)
            if added is None or not self._worthwhile(added.fit, fit, bool(chosen)):
                break
            chosen, fit = self._improved([*chosen, added.candidate], added.fit)
            screened = self._screened(fit, chosen)
        terms = [self._named(chosen[:k] + chosen[k + 1 :], chosen[k]) for k in range(len(chosen))]
        largest: dict[Label, Term] = {}
        for term in sorted(terms, key=lambda term: -term.gain):
            largest.setdefault(term.best.label, term)
        terms = list(largest.values())
        fit = self._fit([term.best for term in terms], fit)
        return SearchResult(tuple(terms), fit, self.gate.candidates, first, screened, self._unexplained(fit))

    # --- moves -------------------------------------------------------------------------------------------------------

    def _worthwhile(self, after: Fit, before: Fit, further: bool) -> bool:
        """Whether an addition gains more than its error, and a further one `least_gain` for each coefficient, too."""
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
        generics = [t for t in tried if t.candidate.mechanism is None and t.candidate.covariate == c.covariate]
        if not naming.known:
            chosen = max([chosen, *generics], key=lambda t: t.gain)
        gain = chosen.gain - float(base.scores.sum())
        return Term(chosen.candidate, self._p_value(c), gain, naming)

    # --- proposals ---------------------------------------------------------------------------------------------------

    def _best(self, base: Fit, others: Sequence[Candidate]) -> Trial | None:
        """What is best added to a fit of the others; a mechanism rather than the generic polynomial."""
        tried = self._tried(base, others)
        known = [t for t in tried if t.candidate.mechanism is not None and self._worthwhile(t.fit, base, bool(others))]
        if not tried:
            return None
        best = chosen_of(known or tried)
        return max([best, *self._in_other_forms(best.candidate, base, others)], key=lambda t: t.gain)

    def _in_other_forms(self, c: Candidate, base: Fit, others: Sequence[Candidate]) -> list[Trial]:
        """The candidate in as simple forms of other kinds, fitted exactly: to first order these may seem as good."""
        if c.basis.is_constant:
            return []
        forms = {basis.name: basis for basis in forms_of(c.covariate, self.rows.evidence.table) if not basis.offset}
        tried = [self._candidate(*c.label, basis) for basis in forms.values() if basis.name != c.basis.name]
        return [self._fitted_with(others, t, base) for t in tried if t.size <= c.size]

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

    def _proposed(self) -> list[Label]:
        """Every mechanism that passed, constant and with every covariate that passed, or in which it may begin early.

        Of mechanics that were not fitted, all parameters may be off, and mimic each other.
        """
        names = list(dict.fromkeys(name for name, _ in self.passed))[:MOST_MECHANISMS]
        along = {*(covariate for _, covariate in self.passed), *CUMULATIVE}
        driven = [(m, covariate) for m, covariate in self._driven if m in names and covariate in along]
        constant = [label for label in self._constants.items() if not self.gate.inputs.learnt or label[0] in names]
        return [label for label in dict.fromkeys([*driven, *constant]) if self._may_have_changed(label)]

    def _may_have_changed(self, label: Label) -> bool:
        """Whether training does not show it to the same degree: of a learnt base, constants must pass themselves."""
        if label in self.passed:
            return True
        constant = self._constants.get(label[0]) == label[1]
        return label not in self.unchanged and not (constant and self.gate.inputs.absorbs)

    @cached_property
    def _driven(self) -> list[Label]:
        """Labels of the candidates that depend on a covariate."""
        return list(dict.fromkeys(c.label for c in self.gate.candidates if not c.basis.is_constant))

    @cached_property
    def _constants(self) -> dict[str | None, str]:
        """By mechanism, the covariate of its constant effect."""
        found = {c.mechanism: c.covariate for c in self.gate.candidates if c.basis.is_constant}
        return found if self.gate.inputs.learnt or not found else {**found, **constant_refinements(self.rows.evidence)}

    def _in_best_form(self, base: Fit, mechanism: str | None, covariate: str) -> tuple[float, Candidate]:
        """The simplest form within a standard error of the best, and its gain, both to first order."""
        key = base, (mechanism, covariate)
        if key not in self.formed:
            self.formed[key] = self._best_form(base, mechanism, covariate)
        return self.formed[key]

    def _best_form(self, base: Fit, mechanism: str | None, covariate: str) -> tuple[float, Candidate]:
        forms = [DriverBasis("constant")] if self._constants.get(mechanism) == covariate else []
        if (mechanism, covariate) in self._driven:
            forms += forms_of(covariate, self.rows.evidence.table)
        every = [self._candidate(mechanism, covariate, basis) for basis in forms]
        scores = [base.with_columns(c.plain) for c in every]
        best = max(scores, key=lambda each: float(each.sum()))
        near = [k for k, each in enumerate(scores) if (best - each).sum() <= standard_error(best - each)]
        k = min(near, key=lambda k: (every[k].size, -scores[k].sum()))
        return float((scores[k] - base.scores).sum()), every[k]

    def _candidate(self, mechanism: str | None, covariate: str, basis: DriverBasis) -> Candidate:
        own = any(c.own for c in self.gate.candidates if c.covariate == covariate)
        return replace(candidate(self.rows.evidence, mechanism, covariate, basis), own=own)

    def _fitted_with(self, others: Sequence[Candidate], c: Candidate, base: Fit) -> Trial:
        """The candidate fitted next to others; a step is moved to where the effect of its size gains most."""
        trial = Trial(c, self._fit([*others, c], base))
        for k in range(MOST_MOVES if c.basis.name == "step" else 0):
            place = best_place(trial.fit, trial.candidate)
            moved = self._candidate(*c.label, replace(c.basis, place=place))
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
        return np.asarray(self._every.z - self._every.shift(fit.effects)) if fit.effects else self._every.z

    @cached_property
    def _every(self) -> FitRows:
        return FitRows(self.gate.evidence)

    def _screened(self, fit: Fit, chosen: Sequence[Candidate]) -> Screened:
        """All candidates on what a fit leaves.

        The gate takes this for noise. With few blocks an obvious effect would drown in itself: noise is then what the
        best fit of one leaves.
        """
        z = self._unexplained(fit)
        first, few = self.gate.screened(z), int(self.gate.evidence.block.max()) + 1 < FEWEST_BLOCKS
        if not few or first.p_value.min() <= self.gate.alpha:
            return first
        order = np.argsort(-first.statistic, kind="stable").tolist()
        labels = {self.gate.candidates[k].label: float(first.p_value[k]) for k in order}
        best = replace(self, passed=labels)._best(fit, chosen)
        gains = np.zeros(1) if best is None else best.fit.scores - fit.scores
        if best is None or gains.sum() < OBVIOUS * standard_error(gains):
            return first
        again, p_value = self.gate.screened(z, self._unexplained(best.fit)), first.p_value.copy()
        same = [k for k, c in enumerate(self.gate.candidates) if c.label == best.candidate.label]
        p_value[same] = np.minimum(p_value[same], again.p_value[same])
        return replace(first, p_value=p_value)

    def _let_pass(self, screened: Screened) -> bool:
        """Note the labels that pass, before those of earlier rounds, the largest statistic first; whether any did."""
        order = np.argsort(-screened.statistic, kind="stable").tolist()
        self.unchanged |= {self.gate.candidates[k].label for k in screened.unchanged}
        new: dict[Label, float] = {}
        for k in order:
            label, p = self.gate.candidates[k].label, float(screened.p_value[k])
            if p <= self.gate.alpha:
                new[label] = min(p, new.get(label, 1.0))
        self.passed = {**new, **{label: p for label, p in self.passed.items() if label not in new}}
        return bool(new)

    def _p_value(self, c: Candidate) -> float:
        """That of the label; else the smallest of its mechanism's labels, or of all."""
        own = [p for label, p in self.passed.items() if label == c.label]
        same = [p for (mechanism, _), p in self.passed.items() if mechanism == c.mechanism]
        return min(own or same or self.passed.values())


def _fitted_exactly(each: Sequence[tuple[float, Candidate]]) -> list[Candidate]:
    """Mechanisms with the largest gains to first order, not far behind the best, and the best generic candidate."""
    ordered = sorted(each, key=lambda pair: -pair[0])
    known = [(gain, c) for gain, c in ordered if c.mechanism is not None]
    near = [c for gain, c in known if gain > CLOSE * known[0][0]]
    return [*near[:MOST_EXACT], *[c for _, c in ordered if c.mechanism is None][:1]]
