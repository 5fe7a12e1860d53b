# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Effects that an exact fit of the others makes superfluous."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtrc

from push_predictor.residuals.candidates.coefficients import estimated_effects
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.selection.term_choice import SelectedTerm
from push_predictor.types import Array

NOT_ZERO = 0.01  # p above which an effect among others may be zero


def needed_terms(terms: Sequence[SelectedTerm], evidence: Evidence) -> tuple[SelectedTerm, ...]:
    """The terms without those whose size may be zero once all are fitted together, the least certain dropped first.

    A constant effect that was selected twice is one: the first fit of it left a part to another term. Terms that a
    refit of the base learns stay.
    """
    terms = _once(terms)
    fitted = [term for term in terms if not term.own]
    while len(fitted) > 1:
        effects, _ = estimated_effects(evidence, [term.best for term in fitted], of_size=True)
        p_values = [p_of_zero(effect.coefficients, effect.covariance) for effect in effects]
        if max(p_values) <= NOT_ZERO:
            break
        del fitted[int(np.argmax(p_values))]
    return tuple(term for term in terms if term.own or any(term is kept for kept in fitted))


def _once(terms: Sequence[SelectedTerm]) -> list[SelectedTerm]:
    """The terms, each constant effect only where it was selected first."""
    first = {term.best.label: term for term in reversed(terms) if term.best.basis.is_constant}
    return [term for term in terms if first.get(term.best.label, term) is term or not term.best.basis.is_constant]


def p_of_zero(coefficients: Array, covariance: Array) -> float:
    """Probability of coefficients (p,) at least as far from zero, if the effect were zero."""
    square = float(coefficients @ np.linalg.pinv(covariance, hermitian=True) @ coefficients)
    return float(chdtrc(len(coefficients), square))
