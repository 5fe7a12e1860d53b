# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Further steps about an analytical base: constant changes of its mechanics, by the ladder of the fitted mechanics.

Several parameters that are off at once mimic each other, and one at a time none of them may fit. So once the search has
found that the base is wrong, the ladder (models/mechanics/ladder.py) adds, drops and replaces constant changes, refits
all of them together and exactly, and keeps what predicts held-out pushes better.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.mechanics.fit import fit_jointly
from push_predictor.models.mechanics.ladder import (
    CLEARLY,
    FEWEST_PUSHES,
    Group,
    Rung,
    all_supports_known,
    climb_from,
    least_gain,
)
from push_predictor.models.mechanisms import LIBRARY, REFINEMENTS, Mechanism, mechanism_named
from push_predictor.models.train import training_rows
from push_predictor.residuals.candidates.candidate import Candidate, candidate
from push_predictor.residuals.candidates.coefficients import estimated_effects
from push_predictor.residuals.candidates.enumeration import HEADED, headed
from push_predictor.residuals.candidates.parameter_changes import ParameterChanges
from push_predictor.residuals.evidence.drivers import CONSTANT
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.selection.cross_validation import Judged, gains_of, log_gains
from push_predictor.residuals.selection.forward_selection import CHANGED, ForwardSelection, SearchResult, search
from push_predictor.residuals.selection.naming import MOST_UNEXPLAINED, Naming
from push_predictor.residuals.selection.pruning import NOT_ZERO, needed_terms, p_of_zero
from push_predictor.residuals.selection.term_choice import SelectedTerm
from push_predictor.types import Array

MOST_ROWS = 800  # windows on which the ladder chooses
SUPERFLUOUS = 0.05  # p, times the number tried, above which a change that was added may be zero
MOST_ROUNDS = 3  # of steps and searches in turn
_REFINING = {mechanism.name for mechanism in REFINEMENTS}


@dataclass(frozen=True, eq=False)
class Steps:
    """The terms after further steps, and what an exact fit of all leaves of the standardised residuals, (n, 3)."""

    terms: tuple[SelectedTerm, ...]
    unexplained: Array


def climbed(found: SearchResult, selection: ForwardSelection) -> SearchResult:
    """The search's result with further steps, and with the effects along covariates that are found after them.

    What is found after them must gain as much as a step of the ladder.
    """
    choice = selection.choice
    for _ in range(MOST_ROUNDS):
        steps = further_steps(found.terms, selection)
        if steps is None:
            break
        again = search(
            choice.evidence,
            choice.candidates,
            choice.inputs,
            selection.alpha,
            choice.seed,
            baseline=selection.baseline,
            terms=steps.terms,
            unexplained=steps.unexplained,
        )
        new = again.terms[len(steps.terms) :]
        more = list(takewhile(lambda term: worthwhile(term, choice.evidence), new))
        if not more:
            return replace(found, terms=steps.terms, last=again.first, unexplained=steps.unexplained)
        terms = needed_terms((*steps.terms, *more), choice.evidence)
        unexplained = steps.unexplained - np.sum([term.shift for term in more], axis=0)
        found = replace(found, terms=terms, last=again.last, unexplained=unexplained)
    return found


def worthwhile(term: SelectedTerm, evidence: Evidence) -> bool:
    """Whether a term of the search gains as much as the ladder asks of a step; an unknown constant effect does not."""
    if term.best.mechanism is None and term.best.basis.is_constant:
        return False
    best, pushes = term.rivals[0], len(evidence.table.pushes)
    least = least_gain(pushes) * best.candidate.plain.shape[2]
    return bool(best.gain > max(least, CLEARLY * best.error))


def further_steps(terms: Sequence[SelectedTerm], selection: ForwardSelection) -> Steps | None:
    """The terms with constant ones added, dropped and replaced; None if there is nothing to change.

    Effects along covariates stay. An unknown constant effect goes if the steps explain it; otherwise nothing changes.
    What a step adds must differ significantly from zero in the joint fit of all.
    """
    evidence, seed = selection.choice.evidence, selection.choice.seed
    driven = [term for term in terms if not term.best.basis.is_constant]
    if not terms or len(evidence.table.pushes) < FEWEST_PUSHES or any(term.best.mechanism is None for term in driven):
        return None
    tried = _constants(evidence)
    now = {term.best.mechanism: term for term in terms if term.best.basis.is_constant}
    began = [c for c in tried if c.mechanism in now]
    chosen, near = _climbed(evidence, [term.best for term in driven], tried, began, seed)
    step = _Step(selection, driven, now, len(tried))
    fitted = step.significant(chosen, near)
    if not step.replaces(chosen, fitted) or {c.mechanism for c in fitted.constants} == set(now):
        return None
    return step.terms(fitted) if None not in now or step.explains(fitted, now[None].best) else None


def _constants(evidence: Evidence) -> list[Candidate]:
    """Constant changes by every mechanism that these windows can show."""
    return [
        candidate(evidence, m.name, HEADED if headed(m.name) else CONSTANT, DriverBasis("constant"))
        for m in (*LIBRARY, *REFINEMENTS)
        if _shows(evidence, m)
    ]


def _shows(evidence: Evidence, mechanism: Mechanism) -> bool:
    mechanics, table = evidence.mechanics.mechanics, evidence.table
    known = mechanics.support is not None or all_supports_known(mechanics, table.covariates)
    if mechanism.name == "rim_pressure" and known:
        return False  # an ellipsoid has no rim either
    speeds = len(np.unique(table.inputs[:, 0])) > 1
    return all(need in table.covariates for need in mechanism.needs) and (speeds or mechanism.name != "inertia")


def _climbed(
    evidence: Evidence, driven: Sequence[Candidate], tried: Sequence[Candidate], start: Sequence[Candidate], seed: int
) -> tuple[list[Candidate], list[Array]]:
    """The constant changes of the ladder's last rung, in their order, and the coefficients of all there.

    The library's are chosen first. A refinement that mimics one of them would otherwise take its place by chance.
    """
    rows = training_rows(evidence.table, None, seed, MOST_ROWS)
    changes = ParameterChanges.of(evidence.take(rows), [c.take(rows) for c in (*driven, *tried)])
    kept, groups = changes.groups[: len(driven)], changes.groups[len(driven) :]
    by_group = dict(zip(groups, tried, strict=True))
    begin = [group for group, c in by_group.items() if c in start]
    known = [group for group, c in by_group.items() if c.mechanism not in _REFINING]
    fit = fit_jointly(changes, changes.rows(), [name for group in (*kept, *begin) for name in group])
    last = climb_from(changes, fit, known)[-1].fit
    last = climb_from(changes, last, groups, Exchange(known, last.rows.pushes).accepts)[-1].fit
    found = sorted((g for g in groups if set(g) <= set(last.names)), key=lambda g: last.names.index(g[0]))
    near = [np.array([last.values[name] for name in group]) for group in (*kept, *found)]
    return [by_group[group] for group in found], near


@dataclass(frozen=True)
class Exchange:
    """The rule for parameters of the library's mechanisms, known, that a step replaces by a refinement."""

    known: Sequence[Group]
    pushes: int

    def accepts(self, rung: Rung) -> bool:
        """Whether a rung replaces none of them, or gains as much as if both its parameters were new."""
        names = {name for group in self.known for name in group}
        if not names & set(rung.dropped) or names >= set(rung.added):
            return True
        return rung.gain > max(least_gain(self.pushes) * len({*rung.added, *rung.dropped}), CLEARLY * rung.error)


def _recorded(c: Candidate, evidence: Evidence) -> bool:
    """Whether these windows have all covariates of a candidate."""
    needs = {*mechanism_named(str(c.mechanism)).needs, *c.basis.drivers}
    return needs <= set(evidence.table.covariates)


def _again(evidence: Evidence, c: Candidate) -> Candidate:
    return candidate(evidence, c.mechanism, c.covariate, c.basis)


def _differ(one: Effect, other: Effect) -> bool:
    difference = one.coefficients - other.coefficients
    return p_of_zero(difference, one.covariance + other.covariance) <= CHANGED


@dataclass(frozen=True, eq=False)
class _Fitted:
    """Constant changes with the effects of all terms, those along covariates first; p (k,): of zero, of each."""

    constants: tuple[Candidate, ...]
    effects: tuple[Effect, ...]
    p_value: Array


@dataclass(frozen=True, eq=False)
class _Step:
    """What the constant terms `now` are changed into, next to the terms along covariates; tried: how many were."""

    selection: ForwardSelection
    driven: Sequence[SelectedTerm]
    now: dict[str | None, SelectedTerm]
    tried: int

    @property
    def evidence(self) -> Evidence:
        return self.selection.choice.evidence

    def significant(self, chosen: Sequence[Candidate], near: Sequence[Array]) -> _Fitted:
        """The chosen changes without those that may be zero, all fitted together; the least certain goes first.

        near: coefficients of all terms near the fit.
        """
        left, start, fixed = list(chosen), list(near), [term.best for term in self.driven]
        while True:
            effects, _ = estimated_effects(
                self.evidence, [*fixed, *left], start=np.concatenate(start) if start else None
            )
            p_value = np.array([p_of_zero(e.coefficients, e.covariance) for e in effects[len(fixed) :]])
            limit = np.array([NOT_ZERO if c.mechanism in self.now else SUPERFLUOUS / self.tried for c in left])
            if np.all(p_value <= limit):
                return _Fitted(tuple(left), effects, np.minimum(self.tried * p_value, 1.0))
            worst = int(np.argmax(p_value / limit))
            del left[worst]
            start = [effect.coefficients for k, effect in enumerate(effects) if k != len(fixed) + worst]

    def replaces(self, chosen: Sequence[Candidate], fitted: _Fitted) -> bool:
        """Whether the changes can replace those before: some remain, and none failed that replaced a known one."""
        dropped = set(self.now) - {None} - {c.mechanism for c in chosen}
        failed = {c.mechanism for c in chosen} - {c.mechanism for c in fitted.constants} - set(self.now)
        return bool(fitted.effects) and not (dropped and failed)

    def explains(self, fitted: _Fitted, unknown: Candidate) -> bool:
        """Whether an unknown constant effect adds little to the changes: the naming rule of a single mechanism."""
        evidence = self.evidence
        before = evidence.z - self._shift(fitted.effects[: len(self.driven)])
        after = evidence.z - self._shift(fitted.effects)
        size = sum(len(effect.coefficients) for effect in fitted.effects[len(self.driven) :])
        gain = float(log_gains(before, after, evidence.block).sum()) - size
        more = max(float(gains_of(after, unknown.columns, evidence.block).sum()), 0.0)
        return gain > 0.0 and more <= MOST_UNEXPLAINED * (more + gain)

    def terms(self, fitted: _Fitted) -> Steps:
        """The terms; those that were there before stay as they were selected."""
        unexplained = self.evidence.z - self._shift(fitted.effects)
        changed = self._changed(fitted)
        found: list[SelectedTerm] = list(self.driven)
        for k, (c, p_value) in enumerate(zip(fitted.constants, fitted.p_value.tolist(), strict=True)):
            term = self.now.get(c.mechanism) or self._term(c, fitted, k, p_value, unexplained)
            found.append(replace(term, since_training=c.covariate == CONSTANT and changed[k]))
        return Steps(tuple(found), unexplained)

    def _term(self, c: Candidate, fitted: _Fitted, k: int, p_value: float, unexplained: Array) -> SelectedTerm:
        number = len(self.driven) + k
        effect = fitted.effects[number]
        others = [*fitted.effects[:number], *fitted.effects[number + 1 :]]
        shift = self._shift(fitted.effects) - self._shift(others)
        z, total = unexplained + shift, float(np.sum(self.evidence.z**2))
        return SelectedTerm(
            best=c,
            rivals=(Judged(c, log_gains(z, unexplained, self.evidence.block)),),
            p_value=p_value,
            coefficients=effect.coefficients,
            shift=shift,
            share=float(np.sum(z**2) - np.sum(unexplained**2)) / total,
            naming=Naming((c.covariate,), (c.mechanism,), True, 0.0),
            own=False,
        )

    def _changed(self, fitted: _Fitted) -> list[bool]:
        """Whether each constant change differs from what the same fit finds in training."""
        baseline = self.selection.baseline
        if baseline is None or len(baseline.evidence.table.pushes) < FEWEST_PUSHES:
            return [False] * len(fitted.constants)
        training, every = baseline.evidence, [*(term.best for term in self.driven), *fitted.constants]
        there = {k: _again(training, c) for k, c in enumerate(every) if _recorded(c, training)}
        effects = dict(zip(there, estimated_effects(training, list(there.values()))[0], strict=True))
        numbers = range(len(self.driven), len(every))
        return [k in effects and _differ(fitted.effects[k], effects[k]) for k in numbers]

    def _shift(self, effects: Sequence[Effect]) -> Array:
        """Standardised shift (n, 3) by effects in addition to those that the model has."""
        evidence, push = self.evidence, self.evidence.push
        both = joint_shift(evidence.mechanics, [*evidence.effects, *effects], push)
        had = joint_shift(evidence.mechanics, evidence.effects, push)
        return np.asarray(np.einsum("nij,nj->ni", evidence.whitener, both - had))
