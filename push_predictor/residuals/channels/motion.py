"""The search on the motion: which mechanism, driven by what, leaves the residual; what else could it be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.residuals.candidates.enumeration import Candidate, candidates_of, entangled
from push_predictor.residuals.channels.variance import Scatter, variance_effects
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, inputs_basis
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of, physics_of
from push_predictor.residuals.outcome import Tested
from push_predictor.residuals.selection.baseline import Baseline, baseline_of
from push_predictor.residuals.selection.cross_validation import fit
from push_predictor.residuals.selection.experiment import separating_pushes
from push_predictor.residuals.selection.forward_selection import Search, Term, search
from push_predictor.residuals.selection.power import detectable_json, minimum_detectable
from push_predictor.residuals.selection.screening import Screened
from push_predictor.types import Array

FELT = 0.15  # an output is named where its shift, in units of the prediction, is this share of the strongest output's
NOTABLE = 1.3  # ratio of deviations; a smaller change of the scatter is told in no verdict
VARIANCE_SHARE = 0.25  # of the motion's alpha


@dataclass(frozen=True, eq=False)
class MotionTerm:
    """One effect of the motion as it may be called; mechanism None: none of the library fits.

    own: whether it lies in the inputs of a learnt base, so that a refit has it.
    """

    mechanism: str | None
    covariate: str
    form: DriverBasis
    outputs: tuple[str, ...]
    p_value: float
    share: float
    own: bool


@dataclass(frozen=True, eq=False)
class MotionFinding:
    """terms: strongest first. equivalent, mechanisms: rivals of the first term's driver and of its mechanism.

    residual (n, 3): standardised, before anything was taken out. deviation (3,): of the standardised residuals of
    training pushes by models that had not seen them, None for an analytical base. scatter: what the variance follows.
    standing: what the base lacks, in words, but lacked in training as much, strongest first. entangled: drivers that
    were not tried, because they go with the inputs.
    """

    terms: tuple[MotionTerm, ...]
    equivalent: tuple[str, ...]
    mechanisms: tuple[str, ...]
    tested: tuple[Tested, ...]
    residual: Array
    deviation: Array | None
    minimum_detectable: Mapping[str, Mapping[str, Any]]
    remaining: str | None
    experiment: tuple[Mapping[str, float], ...]
    scatter: tuple[Scatter, ...]
    standing: tuple[str, ...]
    entangled: tuple[str, ...]


def motion_effects(
    model: PushModel, table: PushTable, alpha: float, names: Sequence[str] | None = None, seed: int = 0
) -> MotionFinding:
    """Search the residuals of a model on windows that it was not trained on. names: drivers, all recorded if None."""
    evidence = evidence_of(model, table, physics_of(model))
    basis, baseline = inputs_basis(model, table), baseline_of(model, physics_of(model))
    share = (1.0 - VARIANCE_SHARE) * alpha
    found = search(evidence, candidates_of(evidence, names, basis), basis, share, seed, baseline=baseline)
    scatter = variance_effects(
        model, evidence, found.left, VARIANCE_SHARE * alpha, seed, names=names, baseline=baseline
    )
    notable = tuple(s for s in scatter.found if not 1.0 / NOTABLE < s.ratio < NOTABLE)
    first = found.terms[0] if found.terms else None
    return MotionFinding(
        terms=tuple(_told(term, evidence, basis) for term in found.terms),
        equivalent=first.naming.drivers[1:] if first else scatter.rivals if notable else (),
        mechanisms=_other_mechanisms(first),
        tested=_tested(found),
        residual=evidence.z,
        deviation=baseline.deviation if basis.learnt else None,
        minimum_detectable=_detectable(found, evidence, basis, share, baseline),
        remaining=_strongest(found.last, found.candidates, share),
        experiment=_experiment(first, evidence, basis),
        scatter=tuple(replace(s, p_value=min(1.0, s.p_value / VARIANCE_SHARE)) for s in notable),
        standing=_standing(found),
        entangled=tuple(entangled(evidence, names, basis)),
    )


def _told(term: Term, evidence: Evidence, basis: InputsBasis) -> MotionTerm:
    best = term.best
    mechanism = best.mechanism if term.naming.known else None
    shift = best.columns @ term.coefficients
    size = np.sqrt(np.mean((shift - shift.mean(axis=0) * (best.kind != "constant")) ** 2, axis=0))
    outputs = tuple(name for name, felt in zip(OUTPUTS, size >= FELT * size.max(), strict=True) if felt)
    own = basis.learnt and (best.kind == "constant" or (best.kind == "speed" and basis.knows_speed))
    return MotionTerm(mechanism, best.covariate, best.form, outputs, _whole(term.p_value), term.share, own)


def _other_mechanisms(first: Term | None) -> tuple[str, ...]:
    if first is None or not first.naming.known:
        return ()
    return tuple(name for name in first.naming.mechanisms if name not in (None, first.best.mechanism))


def _tested(found: Search) -> tuple[Tested, ...]:
    """Every mechanism with every driver once, by its best form, the least p first."""
    best: dict[tuple[str | None, str], float] = {}
    for candidate, p in zip(found.candidates, found.first.p_value.tolist(), strict=True):
        best[candidate.label] = min(p, best.get(candidate.label, 1.0))
    return tuple(Tested(*label, _whole(p)) for label, p in sorted(best.items(), key=lambda item: item[1]))


def _whole(p_value: float) -> float:
    """A p value of the mean's search as one of the motion, which tests the scatter too."""
    return min(1.0, p_value / (1.0 - VARIANCE_SHARE))


def _detectable(
    found: Search, evidence: Evidence, basis: InputsBasis, alpha: float, baseline: Baseline
) -> Mapping[str, Mapping[str, Any]]:
    return detectable_json(minimum_detectable(found, evidence, basis, alpha, baseline))


def _strongest(last: Screened, candidates: Sequence[Candidate], alpha: float) -> str | None:
    """What is still significant after all terms are out, in words; None where nothing is."""
    k = int(np.argmin(last.p_value))
    if last.p_value[k] > alpha:
        return None
    return _in_words(candidates[k])


def _standing(found: Search) -> tuple[str, ...]:
    """The strongest candidate of each driver that acts as it did in training."""
    ordered = sorted(found.first.standing, key=lambda k: -found.first.statistic[k])
    strongest = {found.candidates[k].covariate: found.candidates[k] for k in reversed(ordered)}
    return tuple(_in_words(candidate) for candidate in reversed(strongest.values()))


def _in_words(candidate: Candidate) -> str:
    mechanism, covariate = candidate.label
    return f"{mechanism or 'unknown mechanism'} driven by {covariate}"


def _experiment(first: Term | None, evidence: Evidence, basis: InputsBasis) -> tuple[Mapping[str, float], ...]:
    """Pushes for the rivals of the first term, one for each driver, each as it fits these data."""
    if first is None:
        return ()
    rivals: dict[str, Candidate] = {first.best.covariate: first.best}
    for judged in first.rivals:
        rivals.setdefault(judged.candidate.covariate, judged.candidate)
    out = Residualizer(basis.columns)
    left = out(evidence.z)
    return separating_pushes(evidence, [(c, fit(out(c.columns), left)) for c in rivals.values()])
