# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The motion channel: which mechanisms, depending on which covariates, explain the residual; and their rivals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.models.push_model import PushModel
from push_predictor.residuals.candidates.candidate import SPEED, Candidate
from push_predictor.residuals.candidates.enumeration import candidates_of, confounded
from push_predictor.residuals.channels.variance import VarianceEffect, VarianceFinding, variance_effects
from push_predictor.residuals.evidence.drivers import LOCAL, SESSION
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.outcome import Tested
from push_predictor.residuals.selection.absolute_fit import with_fitting_names
from push_predictor.residuals.selection.baseline import Baseline, baseline_of
from push_predictor.residuals.selection.forward_selection import ForwardSelection, SearchResult, search
from push_predictor.residuals.selection.further_steps import climbed
from push_predictor.residuals.selection.power import detectable_json, minimum_detectable
from push_predictor.residuals.selection.pruning import needed_terms
from push_predictor.residuals.selection.term_choice import SelectedTerm, TermChoice
from push_predictor.types import Array, BoolArray

MOSTLY = 0.5  # share inside training's inputs from which an effect of the speed is more than extrapolation
NOTABLE = 1.15  # ratio of standard deviations; a smaller change of the variance is not reported
VARIANCE_SHARE = 0.25  # of the motion's alpha
FEWEST_PUSHES = 12  # whose variance is judged

Label = tuple[str | None, str]  # mechanism (None: unknown) and covariate


@dataclass(frozen=True, eq=False)
class MotionFinding:
    """What the search on the motion found.

    terms: in the order of selection, parts of others last. equivalent, mechanisms: rivals of the first term's covariate
    and of its mechanism.
    deviation (3,): standard deviation of the cross-validated training residuals, None for an analytical base. variance:
    effects on the variance. unchanged: effects that the base lacks, but lacked in training as much, strongest first.
    confounded: covariates that were not tried, because the inputs explain them. uncompared: because training does
    not show how the outcome depends on them without a change. remaining: the strongest significant candidate after all
    terms.
    """

    terms: tuple[SelectedTerm, ...]
    equivalent: tuple[str, ...]
    mechanisms: tuple[str, ...]
    tested: tuple[Tested, ...]
    deviation: Array | None
    minimum_detectable: Mapping[str, Mapping[str, Any]]
    remaining: Label | None
    variance: tuple[VarianceEffect, ...]
    unchanged: tuple[Label, ...]
    confounded: tuple[str, ...]
    uncompared: tuple[str, ...] = ()


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
    every = [c for c in candidates_of(evidence, names, inputs) if _separable(c, float(known.mean()))]
    candidates = [c for c in every if not baseline.lacks(c.covariate)]
    if not candidates:
        accepted = "one that training recorded, too" if every else "one that the inputs do not change, as they shifted"
        raise RequestError("covariate", ", ".join(names or ()), accepted)
    found = search(evidence, candidates, inputs, share, seed, baseline=baseline)
    found = replace(found, terms=needed_terms(found.terms, evidence))
    if not (inputs.learnt or inputs.absorbs):  # a refit of such a base keeps its parameters
        found = climbed(found, ForwardSelection(TermChoice(evidence, found.candidates, inputs, seed), share, baseline))
    found = replace(found, terms=with_fitting_names(found.terms))  # last: the ladder may explain what a name leaves
    spread = _spread(model, evidence.take(known), found.unexplained[known], alpha, names, seed, baseline)
    notable = tuple(s for s in spread.found if not 1.0 / NOTABLE < s.ratio < NOTABLE)
    first = found.terms[0] if found.terms else None
    return MotionFinding(
        terms=tuple(replace(term, p_value=_of_motion(term.p_value)) for term in found.terms),
        equivalent=first.naming.drivers[1:] if first else spread.rivals if notable else (),
        mechanisms=_other_mechanisms(first),
        tested=_tested(found),
        deviation=baseline.deviation if inputs.learnt else None,
        minimum_detectable={
            **detectable_json(minimum_detectable(found, evidence, inputs, share, baseline)),
            **_detectable_noise(spread),
        },
        remaining=_remaining(found, share),
        variance=tuple(replace(s, p_value=min(1.0, s.p_value / VARIANCE_SHARE)) for s in notable),
        unchanged=_unchanged(found),
        confounded=tuple(confounded(evidence, names, inputs)),
        uncompared=tuple(dict.fromkeys(c.covariate for c in every if baseline.lacks(c.covariate))),
    )


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
    if candidate.mechanism is None or candidate.basis.is_constant or candidate.covariate in LOCAL:
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
        return VarianceFinding((), ())
    return variance_effects(model, evidence, z, VARIANCE_SHARE * alpha, seed, names=names, baseline=baseline)


def _other_mechanisms(first: SelectedTerm | None) -> tuple[str, ...]:
    if first is None or not first.naming.known:
        return ()
    return tuple(name for name in first.naming.mechanisms if name is not None and name != first.mechanism)


def _tested(found: SearchResult) -> tuple[Tested, ...]:
    """Every mechanism with every covariate once, in its best basis, smallest p first."""
    best: dict[Label, float] = {}
    for candidate, p in zip(found.candidates, found.first.p_value.tolist(), strict=True):
        best[candidate.label] = min(p, best.get(candidate.label, 1.0))
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
    return tuple(candidate.label for candidate in reversed(strongest.values()))
