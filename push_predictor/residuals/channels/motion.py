# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The motion channel: which mechanisms, depending on which covariates, explain the residual; and their rivals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import chdtrc

from push_predictor.errors import RequestError
from push_predictor.models.effects.effect import Effect
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import OUTPUTS, concatenate
from push_predictor.residuals.candidates.candidate import SPEED, Candidate, candidate, candidates_of, confounded
from push_predictor.residuals.candidates.joint_fit import FitRows, estimated, fitted
from push_predictor.residuals.channels.variance import VarianceEffect, VarianceFinding, variance_effects
from push_predictor.residuals.evidence.drivers import CONSTANT, SESSION
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, inputs_basis
from push_predictor.residuals.evidence.split import FEWEST_PUSHES
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.outcome import Tested
from push_predictor.residuals.selection.baseline import Baseline, baseline_of
from push_predictor.residuals.selection.gate import Gate
from push_predictor.residuals.selection.naming import MOST_UNEXPLAINED, REJECTED
from push_predictor.residuals.selection.power import minimum_detectable
from push_predictor.residuals.selection.search import Label, SearchResult, Term, search
from push_predictor.types import Array, BoolArray

MOSTLY = 0.5  # share inside training's inputs from which an effect of the speed is more than extrapolation
VARIANCE_SHARE = 0.25  # of the motion's alpha
FELT = 0.15  # an output is named if its standardised shift is at least this share of the strongest output's


@dataclass(frozen=True, eq=False)
class MotionTerm:
    """A term of the search, judged as a part of the model.

    outputs: those that it shifts. share: of the sum of squares of the standardised residual. own: whether it lies in
    the inputs of a learnt base, so that a refit learns it. since_training: whether a constant effect is a change since
    training. part: whether it is what the fit of a larger one leaves, rather than an effect.
    """

    term: Term
    p_value: float
    outputs: tuple[str, ...]
    share: float
    own: bool
    since_training: bool
    part: bool

    @property
    def best(self) -> Candidate:
        """Mechanism, covariate and form."""
        return self.term.best

    @property
    def mechanism(self) -> str | None:
        """See Term."""
        return self.term.mechanism

    @property
    def resembles(self) -> str | None:
        """The mechanism that comes closest, where none fits."""
        return self.term.naming.resembles


@dataclass(frozen=True, eq=False)
class MotionFinding:
    """What the search on the motion found.

    terms: the largest gain first, parts of others last. equivalent, mechanisms: rivals of the first term's covariate
    and of its mechanism.
    deviation (3,): standard deviation of the cross-validated training residuals, None for an analytical base. variance:
    effects on the variance. unchanged: effects that the base lacks, but lacked in training as much, strongest first.
    confounded: covariates that were not tried, because the inputs explain them. remaining: the strongest
    significant candidate after all terms.
    """

    terms: tuple[MotionTerm, ...]
    equivalent: tuple[str, ...]
    mechanisms: tuple[str, ...]
    tested: tuple[Tested, ...]
    deviation: Array | None
    minimum_detectable: Mapping[str, Mapping[str, Any]]
    remaining: Label | None
    variance: tuple[VarianceEffect, ...]
    unchanged: tuple[Label, ...]
    confounded: tuple[str, ...]


NO_MOTION = MotionFinding((), (), (), (), None, {}, None, (), (), ())


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

    inside (n,): windows among the inputs of training, all if None. Elsewhere the model extrapolates: its noise is not
    judged, and an error that depends on the inputs alone is no effect.
    """
    inputs = inputs_basis(model, evidence.table)
    baseline = baseline_of(model, evidence.mechanics, evidence.table.inputs)
    share = (1.0 - VARIANCE_SHARE) * alpha
    known = np.ones(len(evidence.table), dtype=np.bool_) if inside is None else inside
    candidates = tuple(c for c in candidates_of(evidence, names, inputs) if _separable(c, float(known.mean())))
    if not candidates:
        raise RequestError("covariate", ", ".join(names or ()), "one that the inputs do not change, as they shifted")
    found = search(Gate(evidence, candidates, inputs, share, seed, baseline), _rows(model, evidence, baseline, inputs))
    spread = _spread(model, evidence.take(known), found.unexplained[known], alpha, names, seed, baseline)
    terms = _judged(found, evidence, inputs, baseline)
    first = terms[0].term if terms else None
    return MotionFinding(
        terms=terms,
        equivalent=first.naming.covariates[1:] if first else spread.rivals,
        mechanisms=tuple(name for name in first.naming.mechanisms[1:] if name is not None) if first else (),
        tested=_tested(found),
        deviation=baseline.deviation if inputs.learnt else None,
        minimum_detectable={
            **minimum_detectable(found, evidence, inputs, share, baseline),
            **_detectable_noise(spread),
        },
        remaining=_remaining(found, share),
        variance=tuple(replace(s, p_value=min(1.0, s.p_value / VARIANCE_SHARE)) for s in spread.found),
        unchanged=_unchanged(found),
        confounded=tuple(confounded(evidence, names, inputs)),
    )


def _rows(model: PushModel, evidence: Evidence, baseline: Baseline, inputs: InputsBasis) -> FitRows:
    """The windows of the fits: with those of training where a learnt base may have missed a function of its inputs."""
    _, few = evidence.thinned
    if not (inputs.learnt and inputs.absorbs):
        return FitRows(few)
    _, before = baseline.evidence.thinned
    return FitRows(few, before, inputs_basis(model, concatenate([few.table, before.table])).columns)


def _judged(found: SearchResult, evidence: Evidence, inputs: InputsBasis, baseline: Baseline) -> tuple[MotionTerm, ...]:
    fit, total = found.fit, float(np.sum(evidence.z**2))
    explained = max(1.0 - float(np.sum(found.unexplained**2)) / total, 0.0)
    gains = [max(term.gain, 0.0) for term in found.terms]
    changed = _changed(found, inputs, baseline)
    terms = [
        MotionTerm(
            term,
            _of_motion(term.p_value),
            _outputs(fit.columns[:, :, part] @ fit.coefficients[part]),
            explained * gain / max(sum(gains), np.finfo(float).tiny),
            inputs.absorbs and term.best.kind == "constant",
            bool(term.best.covariate == CONSTANT and own),
            _is_left(term, found.terms[:k]),
        )
        for k, (term, gain, part, own) in enumerate(zip(found.terms, gains, fit.parts, changed, strict=True))
    ]
    return tuple(sorted(terms, key=lambda term: term.part))


def _is_left(term: Term, larger: Sequence[Term]) -> bool:
    """Whether a term is what the fit of a larger one leaves: small beside one with its mechanism or covariate."""
    return any(
        term.gain < MOST_UNEXPLAINED * other.gain
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
    _, before = baseline.evidence.thinned
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
    return bool(chdtrc(len(change), square) <= REJECTED)


def _detectable_noise(spread: VarianceFinding) -> dict[str, Mapping[str, Any]]:
    if not np.isfinite(spread.detectable):
        return {}
    return {"noise": {"value": spread.detectable, "unit": "times training", "covariate": SESSION}}


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


def _spread(
    model: PushModel,
    evidence: Evidence,
    z: Array,
    alpha: float,
    names: Sequence[str] | None,
    seed: int,
    baseline: Baseline,
) -> VarianceFinding:
    if len(evidence.table.pushes) < FEWEST_PUSHES:
        return VarianceFinding()
    return variance_effects(model, evidence, z, VARIANCE_SHARE * alpha, seed, names=names, baseline=baseline)


def _tested(found: SearchResult) -> tuple[Tested, ...]:
    """Every mechanism with every covariate once, in its best basis, smallest p first."""
    best: dict[Label, float] = {}
    for tried, p in zip(found.candidates, found.first.p_value.tolist(), strict=True):
        best[tried.label] = min(p, best.get(tried.label, 1.0))
    return tuple(Tested(*label, _of_motion(p)) for label, p in sorted(best.items(), key=lambda item: item[1]))


def _of_motion(p_value: float) -> float:
    """A p value of the search on the mean as one of the motion, which tests the variance too."""
    return min(1.0, p_value / (1.0 - VARIANCE_SHARE))


def _remaining(found: SearchResult, alpha: float) -> Label | None:
    k = int(np.argmin(found.last.p_value))
    return None if found.last.p_value[k] > alpha else found.candidates[k].label


def _unchanged(found: SearchResult) -> tuple[Label, ...]:
    """The strongest candidate of each covariate that acts as it did in training."""
    ordered = sorted(found.first.unchanged, key=lambda k: -found.first.statistic[k])
    strongest = {found.candidates[k].covariate: found.candidates[k] for k in reversed(ordered)}
    return tuple(one.label for one in reversed(strongest.values()))
