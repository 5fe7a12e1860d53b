# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The motion channel: which mechanisms, depending on which covariates, explain the residual; and their rivals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.special import chdtrc

from push_predictor.errors import RequestError
from push_predictor.models.effects.effect import Effect
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import OUTPUTS, concatenate
from push_predictor.residuals.candidates.candidate import SPEED, Candidate, candidate, candidates_of, confounded
from push_predictor.residuals.candidates.joint_fit import FitRows, estimated, fitted
from push_predictor.residuals.evidence.drivers import CONSTANT
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, inputs_basis
from push_predictor.residuals.evidence.standardised import FEWEST_PUSHES, Evidence
from push_predictor.residuals.outcome import Tested, best_of, in_trace
from push_predictor.residuals.selection.gate import Baseline, Gate, baseline_of
from push_predictor.residuals.selection.power import minimum_detectable
from push_predictor.residuals.selection.search import Label, SearchResult, Term, search
from push_predictor.types import Array, BoolArray

MOSTLY = 0.5  # share inside training's inputs from which an effect of the speed is more than extrapolation
DIFFERENT = 0.01  # probability that an effect which differs from that in training is the same
MOST_AT_ONCE = 2  # changes since training: guards against one outside the library, which a sum of its effects imitates
LEFT = 0.15  # of the gain of a larger effect: less is what its fit leaves
FELT = 0.15  # an output is named if its standardised shift is at least this share of the strongest output's


@dataclass(frozen=True, eq=False)
class MotionTerm(Term):
    """A term of the search, judged as a part of the model.

    outputs: those that it shifts. share: of the sum of squares of the standardised residual. own: whether it lies in
    the inputs of a learnt base, so that a refit learns it. since_training: whether a constant effect is a change since
    training. part: whether it belongs to a larger one, rather than being an effect of its own.
    """

    outputs: tuple[str, ...]
    share: float
    own: bool
    since_training: bool
    part: bool


@dataclass(frozen=True, eq=False)
class MotionFinding:
    """What the search on the motion found.

    terms: the largest gain first, parts of others last. equivalent, mechanisms: rivals of the first term's covariate
    and of its mechanism.
    unchanged: effects that the base lacks, but lacked in training as much, strongest first. confounded: covariates that
    were not tried, because the inputs explain them. remaining: the strongest significant candidate after all terms.
    unexplained (n, 3): the standardised residuals minus the terms. training: evidence of the training windows.
    """

    terms: tuple[MotionTerm, ...]
    equivalent: tuple[str, ...]
    mechanisms: tuple[str, ...]
    tested: tuple[Tested, ...]
    minimum_detectable: Mapping[str, Mapping[str, Any]]
    remaining: Label | None
    unchanged: tuple[Label, ...]
    confounded: tuple[str, ...]
    unexplained: Array = field(default_factory=lambda: np.empty((0, 3)))
    training: Evidence | None = None

    def family_wise(self, share: float) -> MotionFinding:
        """The same with p values of the whole trace; share: of alpha, that the search may spend."""
        terms = tuple(replace(term, p_value=min(1.0, term.p_value / share)) for term in self.terms)
        return replace(self, terms=terms, tested=in_trace(self.tested, share))


NO_MOTION = MotionFinding((), (), (), (), {}, None, (), ())


def motion_effects(
    model: PushModel,
    evidence: Evidence,
    alpha: float,
    names: Sequence[str] | None = None,
    seed: int = 0,
    *,
    inside: BoolArray | None = None,
) -> MotionFinding:
    """Search the evidence of a model on windows that it was not trained on; names: covariates, all recorded if None.

    inside (n,): windows among the inputs of training, all if None. Elsewhere the model extrapolates: an error that
    depends on the inputs alone is no effect.
    """
    inputs = inputs_basis(model, evidence.table)
    baseline = baseline_of(model, evidence.mechanics, evidence.table.inputs)
    known = 1.0 if inside is None else float(inside.mean())
    candidates = tuple(c for c in candidates_of(evidence, names, inputs) if _separable(c, known))
    if not candidates:
        raise RequestError("covariate", ", ".join(names or ()), "one that the inputs do not change, as they shifted")
    found = search(Gate(evidence, candidates, inputs, alpha, seed, baseline), _rows(model, evidence, baseline, inputs))
    terms = _judged(found, evidence, inputs, baseline)
    first = terms[0] if terms else None
    return MotionFinding(
        terms=terms,
        equivalent=first.naming.covariates[1:] if first else (),
        mechanisms=tuple(name for name in first.naming.mechanisms[1:] if name is not None) if first else (),
        tested=best_of([c.label for c in found.candidates], found.first.p_value.tolist()),
        minimum_detectable=minimum_detectable(found, evidence, inputs, alpha, baseline),
        remaining=_remaining(found, alpha),
        unchanged=_unchanged(found),
        confounded=tuple(confounded(evidence, names, inputs)),
        unexplained=found.unexplained,
        training=baseline.evidence,
    )


def _rows(model: PushModel, evidence: Evidence, baseline: Baseline, inputs: InputsBasis) -> FitRows:
    """The windows of the fits: with those of training where a learnt base may have missed a function of its inputs."""
    few = evidence.thinned
    if not (inputs.learnt and inputs.absorbs):
        return FitRows(few)
    before = baseline.evidence.thinned
    return FitRows(few, before, inputs_basis(model, concatenate([few.table, before.table])).columns)


def _judged(found: SearchResult, evidence: Evidence, inputs: InputsBasis, baseline: Baseline) -> tuple[MotionTerm, ...]:
    fit, total = found.fit, float(np.sum(evidence.z**2))
    explained = max(1.0 - float(np.sum(found.unexplained**2)) / total, 0.0)
    gains = [max(term.gain, 0.0) for term in found.terms]
    changed = _changed(found, inputs, baseline)
    terms = [
        MotionTerm(
            term.best,
            term.p_value,
            term.gain,
            term.naming,
            _outputs(fit.columns[:, :, part] @ fit.coefficients[part]),
            explained * gain / max(sum(gains), np.finfo(float).tiny),
            inputs.absorbs and term.best.kind == "constant",
            bool(term.best.covariate == CONSTANT and own),
            _is_left(term, found.terms[:k]),
        )
        for k, (term, gain, part, own) in enumerate(zip(found.terms, gains, fit.parts, changed, strict=True))
    ]
    in_order = tuple(sorted(terms, key=lambda term: term.part))
    return _as_one(in_order) if inputs.learnt else in_order


def _as_one(terms: tuple[MotionTerm, ...]) -> tuple[MotionTerm, ...]:
    """Terms about a learnt base, the largest first; more than MOST_AT_ONCE are one effect without a name."""
    if sum(not term.part for term in terms) <= MOST_AT_ONCE:
        return terms
    first, *others = terms
    resembles = first.naming.resembles or first.best.mechanism
    naming = replace(first.naming, mechanisms=(None,), known=False, resembles=resembles)
    outputs = tuple(name for name in OUTPUTS if any(name in term.outputs for term in terms))
    whole = replace(first, naming=naming, outputs=outputs, share=sum(term.share for term in terms))
    return (whole, *(replace(term, part=True) for term in others))


def _is_left(term: Term, larger: Sequence[Term]) -> bool:
    """Whether a term is what the fit of a larger one leaves: small beside one with its mechanism or covariate."""
    return any(
        term.gain < LEFT * other.gain
        and (term.best.mechanism == other.best.mechanism or {*term.naming.covariates} & {*other.naming.covariates})
        for other in larger
    )


def _outputs(shift: Array) -> tuple[str, ...]:
    """Names of the outputs that a standardised shift (n, 3) changes."""
    size = np.sqrt(np.mean(shift**2, axis=0))
    return tuple(name for name, felt in zip(OUTPUTS, size >= FELT * size.max(), strict=True) if felt)


def _changed(found: SearchResult, inputs: InputsBasis, baseline: Baseline) -> list[bool]:
    """Whether each term differs from what the same fit finds in training; of a learnt base every one does."""
    if not found.terms or inputs.learnt or len(baseline.evidence.table.pushes) < FEWEST_PUSHES:
        return [inputs.learnt] * len(found.terms)
    before = baseline.evidence.thinned
    recorded = [
        k
        for k, effect in enumerate(found.fit.effects)
        if {*effect.needs} <= {*before.table.covariates} and baseline.comparable(effect.basis)
    ]
    again = [candidate(before, *found.terms[k].best.label, found.terms[k].best.basis) for k in recorded]
    now, then = estimated(found.fit)[0], dict(zip(recorded, estimated(fitted(FitRows(before), again))[0], strict=True))
    return [k in then and _differ(effect, then[k]) for k, effect in enumerate(now)]


def _differ(one: Effect, other: Effect) -> bool:
    change, covariance = one.coefficients - other.coefficients, one.covariance + other.covariance
    square = float(change @ np.linalg.pinv(covariance, hermitian=True) @ change)
    return bool(chdtrc(len(change), square) <= DIFFERENT)


def _separable(candidate: Candidate, inside: float) -> bool:
    """Whether an effect differs from an error of extrapolation; inside: share of windows among training's inputs.

    Where some windows lie outside, many lie at the ends of training's range. There the errors of a model are larger,
    and differ along a push.
    """
    if inside == 1.0:
        return True
    if candidate.mechanism is None or candidate.basis.is_constant:
        return False
    return candidate.covariate != SPEED or inside >= MOSTLY


def _remaining(found: SearchResult, alpha: float) -> Label | None:
    k = int(np.argmin(found.last.p_value))
    return None if found.last.p_value[k] > alpha else found.candidates[k].label


def _unchanged(found: SearchResult) -> tuple[Label, ...]:
    """The strongest candidate of each covariate that acts as it did in training."""
    ordered = sorted(found.first.unchanged, key=lambda k: -found.first.statistic[k])
    strongest = {found.candidates[k].covariate: found.candidates[k] for k in reversed(ordered)}
    return tuple(one.label for one in reversed(strongest.values()))
