# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A name needs absolute fit: what an effect leaves must not depend on what its mechanism itself depends on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from push_predictor.models.effects.covariate_range import HEADINGS
from push_predictor.residuals.candidates.enumeration import headed
from push_predictor.residuals.evidence.drivers import CONSTANT
from push_predictor.residuals.selection.naming import MOST_UNEXPLAINED
from push_predictor.residuals.selection.term_choice import SelectedTerm


def with_fitting_names(terms: Sequence[SelectedTerm]) -> tuple[SelectedTerm, ...]:
    """The terms without names that do not fit: what such a mechanism leaves is an unknown effect, found later.

    The model keeps the mechanism's response, which explained most. The mechanism is what the unknown effect resembles.
    Of a mechanism that acts always and more along a covariate, the part that tells the covariate comes first. What the
    fit of an effect leaves of it comes last.
    """
    terms = _driven_first(terms)
    misfits = {term.mechanism for k, term in enumerate(terms) if any(_withdraws(t, term) for t in terms[k + 1 :])}
    fitting = [_unnamed(term) if term.mechanism in misfits else term for term in terms]
    return tuple(fitting[k] for k in np.argsort(parts_of_others(fitting), kind="stable"))


def _driven_first(terms: Sequence[SelectedTerm]) -> list[SelectedTerm]:
    """The terms, a constant effect behind the first of the same mechanism that depends on a covariate."""
    ordered = list(terms)
    for k, constant in enumerate(terms):
        if constant.mechanism is None or not constant.best.basis.is_constant:
            continue
        driven = [t for t in terms[k:] if t.mechanism == constant.mechanism and not t.best.basis.is_constant]
        if driven:
            i, j = (next(n for n, t in enumerate(ordered) if t is one) for one in (constant, driven[0]))
            ordered[i], ordered[j] = ordered[j], ordered[i]
    return ordered


def parts_of_others(terms: Sequence[SelectedTerm]) -> list[bool]:
    """For each term whether the fit of an earlier one left it, so that it is no effect of its own."""
    return [any(left_by(earlier, term) for earlier in terms[:k]) for k, term in enumerate(terms)]


def left_by(effect: SelectedTerm, later: SelectedTerm) -> bool:
    """Whether a term found later is what the fit of an effect leaves of it, rather than another effect.

    For a named effect: an unknown one along the same dependence, or one of its own mechanism that is constant, along
    the same covariate, or small.
    """
    if effect.mechanism is not None:
        if later.mechanism == effect.mechanism:
            same = later.best.basis.is_constant or later.best.covariate == effect.best.covariate
            return same or not _large_beside(later, effect)
        return later.mechanism is None and later.best.covariate in _dependence(effect)
    same = _closest(effect) is not None and _closest(later) == _closest(effect)
    return same or (later.mechanism is None and later.best.covariate in {CONSTANT, *_dependence(effect)})


def _withdraws(later: SelectedTerm, named: SelectedTerm) -> bool:
    """Whether a name does not fit: a later term is a large part of what depends on the same."""
    if named.mechanism is None or named.mechanism == later.mechanism or not left_by(named, later):
        return False
    return _large_beside(later, named)


def _large_beside(later: SelectedTerm, effect: SelectedTerm) -> bool:
    """Whether a term found later has more of both gains than the fit of one effect may leave."""
    left, explained = (max(term.rivals[0].gain, 0.0) for term in (later, effect))
    return left > MOST_UNEXPLAINED * (left + explained)


def _unnamed(term: SelectedTerm) -> SelectedTerm:
    naming = replace(term.naming, mechanisms=(None,), known=False, resembles=term.best.mechanism)
    return replace(term, naming=naming)


def _closest(term: SelectedTerm) -> str | None:
    """The mechanism of a term, or the one that it resembles."""
    return term.mechanism or term.naming.resembles


def _dependence(term: SelectedTerm) -> set[str]:
    """The covariates that a term may depend on: its possible drivers, and those of its mechanism's response."""
    return {*term.naming.drivers, *(HEADINGS if headed(_closest(term)) else ())}
