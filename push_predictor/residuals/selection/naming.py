# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The name of an effect: which covariates and which mechanisms remain possible, and whether any mechanism fits.

What was tried in place of a term remains possible unless its gain is smaller by more than chance from block to block. A
mechanism is named only if little is gained in addition by what no mechanism does: a polynomial along the same
covariate, or an effect that passes with the first window of a push.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from scipy.special import ndtri

from push_predictor.residuals.candidates.candidate import Candidate, candidate
from push_predictor.residuals.candidates.joint_fit import Fit, standard_error
from push_predictor.residuals.evidence.drivers import at_touch
from push_predictor.types import Array

REJECTED = 0.01  # probability that a rival which is rejected is the right one
ROUNDING = 1e-6  # nats: fits along covariates that are one in other units differ by less
MOST_UNEXPLAINED = 0.15  # of the gain along a covariate: mechanics that are nearly right leave as much of an effect


@dataclass(frozen=True, eq=False)
class Trial:
    """A term tried next to others: the joint fit of all, in which it comes last."""

    candidate: Candidate
    fit: Fit

    @property
    def gain(self) -> float:
        """Log density of blocks that it was not fitted to, up to a constant that all trials share."""
        return float(self.fit.scores.sum())


@dataclass(frozen=True)
class Naming:
    """Possible covariates and mechanisms of an effect, the best first; known: whether a mechanism of the library fits.

    resembles: where no mechanism fits, the one that comes closest.
    """

    covariates: tuple[str, ...]
    mechanisms: tuple[str | None, ...]
    known: bool
    resembles: str | None = None


def naming_of(chosen: Trial, tried: Sequence[Trial], base: Fit) -> Naming:
    """The names of a chosen term; tried: in its place, next to the others whose fit is `base`."""
    possible = sorted((t for t in tried if _possible(t, chosen)), key=lambda t: -t.gain)
    covariates = dict.fromkeys([chosen.candidate.covariate, *(t.candidate.covariate for t in possible)])
    same = [t.candidate.mechanism for t in possible if t.candidate.covariate == chosen.candidate.covariate]
    mechanism = chosen.candidate.mechanism
    if mechanism is None or unexplained_share(chosen, base) > MOST_UNEXPLAINED:
        closest = [t.candidate.mechanism for t in sorted(tried, key=lambda t: -t.gain) if t.candidate.mechanism]
        return Naming(tuple(covariates), (None,), False, mechanism or next(iter(closest), None))
    mechanisms = dict.fromkeys([mechanism, *(name for name in same if name is not None)])
    return Naming(tuple(covariates), tuple(mechanisms), True)


def chosen_of(tried: Sequence[Trial]) -> Trial:
    """The one with the largest gain, or the constant effect of its mechanism where that is not rejected.

    An effect that nothing was seen to change is constant.
    """
    best = max(tried, key=lambda t: t.gain)
    same = [t for t in tried if t.candidate.mechanism == best.candidate.mechanism and t.candidate.basis.is_constant]
    return next((t for t in same if not _rejected(t.fit, best.fit)), best)


def unexplained_share(chosen: Trial, base: Fit) -> float:
    """Share of the gain along its covariate that the mechanism cannot achieve; 0 if that may be chance.

    The generic polynomial may do what it cannot. And parameters of the mechanics act on all windows of a push alike:
    what acts on the first only wears off as the slider moves.
    """
    c, fit = chosen.candidate, chosen.fit
    evidence = fit.rows.evidence
    generic, first = candidate(evidence, None, c.covariate, c.basis), at_touch(evidence.table)[:, None, None]
    gain = max(float((fit.scores - base.scores).sum()), 0.0)
    more = [fit.with_columns(columns) - fit.scores for columns in (generic.plain, c.plain * first)]
    return max([float(m.sum()) / (float(m.sum()) + gain) for m in more if surely(m, REJECTED)], default=0.0)


def surely(gains: Array, level: float) -> bool:
    """Whether a gain (b,) of blocks is larger than zero by more than chance; level: probability of such a chance."""
    return float(gains.sum()) > ROUNDING - float(ndtri(level)) * standard_error(gains)


def _possible(other: Trial, chosen: Trial) -> bool:
    """Whether these data do not reject a rival; that a constant effect changes must gain more than its error."""
    if chosen.candidate.basis.is_constant and not other.candidate.basis.is_constant:
        gains = other.fit.scores - chosen.fit.scores
        return float(gains.sum()) > standard_error(gains)
    return not _rejected(other.fit, chosen.fit)


def _rejected(fit: Fit, best: Fit) -> bool:
    return fit is not best and surely(best.scores - fit.scores, REJECTED)
