# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Forward selection of the forward model's parameters, by cross-validation over whole pushes: the ladder."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from push_predictor.models.mechanics.fit import (
    FitRows,
    JointFit,
    fit_jointly,
    refit,
    student_curvature,
    student_loss,
    student_weights,
    with_candidates,
)
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME, PARAMETERS
from push_predictor.types import Array
from push_predictor.watch import Watch, no_watch

MOST_STEPS = 20
MOST_PARAMETERS = 12
LEAST_EVIDENCE = 5.0  # nats for each added parameter: among hundreds of changes, some gain less by chance
LEAST_GAIN = 0.03  # nats per push and parameter: less is not worth it
FEWEST_PUSHES = 3  # of a cross-validation
CLEARLY = 1.0  # standard errors from push to push: the one standard error rule
REFITTED = 3  # changes with the largest expected gains that are refitted before one is chosen


@dataclass(frozen=True)
class Change:
    """A change of the set of free parameters, with the gain that is expected to first order."""

    added: tuple[str, ...]
    dropped: tuple[str, ...] = ()
    expected: float = 0.0


@dataclass(frozen=True, eq=False)
class Rung:
    """A step of the ladder: the parameters that it adds and drops, and the joint fit after it. The first has neither.

    gain, error: of the held-out log density, nats over all pushes, and its standard error from push to push. rivals:
    the next best changes.
    """

    fit: JointFit
    added: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()
    gain: float = 0.0
    error: float = 0.0
    rivals: tuple[Change, ...] = ()


def climb(mechanics: PushMechanics, rows: FitRows, watch: Watch = no_watch) -> list[Rung]:
    """The rungs of the ladder, from the textbook's parameters on.

    Each step adds the parameter that improves the log density of held-out pushes most, if by more than one standard
    error from push to push, and refits all of them together. Some parameters show only in pairs, and others mimic a
    pair for a while. So where no single parameter helps, the step adds two, or takes one or two in place of one.
    Candidates are all parameters whose covariates the rows have, and that the support and the data can show.
    """
    rungs, names = [Rung(fit_jointly(mechanics, rows, ()))], candidates(mechanics, rows)
    while len(rungs) <= MOST_STEPS and rows.pushes >= FEWEST_PUSHES:
        watch(f"fit mechanics: step {len(rungs)}", min(0.8, 0.08 * len(rungs)))
        found = _next(mechanics, rungs[-1].fit, names)
        if found is None:
            break
        rungs.append(found)
    return rungs


def candidates(mechanics: PushMechanics, rows: FitRows) -> list[str]:
    """Names of the parameters that these rows can show; the rim exponent is the one of the pressure's spread."""
    on_patch = mechanics.support is None and not all_supports_known(mechanics, rows.covariates)
    return [
        parameter.name
        for parameter in PARAMETERS
        if all(name in rows.covariates for name in parameter.needs)
        and (on_patch or parameter.name != "rim_exponent")
        and parameter.name != "pressure_spread"
        and (len(np.unique(rows.inputs[:, 0])) > 1 or parameter.name not in ("clock_delay", "inertia"))
    ]


def all_supports_known(mechanics: PushMechanics, covariates: Mapping[str, Array]) -> bool:
    """Whether the mechanics know the supports of all recordings of these pushes."""
    recording = covariates.get("recording")
    return recording is not None and set(np.unique(recording).tolist()) <= set(mechanics.supports)


def _next(mechanics: PushMechanics, fit: JointFit, names: Sequence[str]) -> Rung | None:
    """The next rung, None if no change of the free parameters helps."""
    others = [name for name in names if name not in fit.names]
    wide = with_candidates(mechanics, fit, others)
    known = CrossValidation(wide)
    now = known.scores(fit.names)
    for changes in (_single(others), _exchanges([name for name in names if name in fit.names], others)):
        ranked = [Change(c.added, c.dropped, float((now - known.scores(_after(fit, c))).sum())) for c in changes]
        ranked = sorted((c for c in ranked if c.expected > _least(fit, c)), key=lambda c: -c.expected)
        rungs = [_taken(mechanics, fit, wide, change, ranked) for change in ranked[:REFITTED]]
        if good := [rung for rung in rungs if worthwhile(fit, rung)]:
            return max(good, key=lambda rung: rung.gain)
    return None


def _single(others: Sequence[str]) -> Iterator[Change]:
    return (Change((name,)) for name in others)


def _exchanges(free: Sequence[str], others: Sequence[str]) -> Iterator[Change]:
    """Pairs to add, parameters to drop, and one or two in place of one."""
    pairs = list(combinations(others, 2))
    yield from (Change(pair) for pair in pairs)
    for name in free:
        yield Change((), (name,))
        yield from (Change(other, (name,)) for other in (*((single,) for single in others), *pairs))


def _after(fit: JointFit, change: Change) -> tuple[str, ...]:
    """Names of the free parameters after a change."""
    return (*(name for name in fit.names if name not in change.dropped), *change.added)


def _least(fit: JointFit, change: Change) -> float:
    """The smallest gain that is worth a change, nats."""
    return least_gain(fit.rows.pushes) * max(len(change.added) - len(change.dropped), 0.5)


def least_gain(pushes: int) -> float:
    """The smallest gain that is worth another parameter, nats over all pushes."""
    return max(LEAST_EVIDENCE, LEAST_GAIN * pushes)


def _taken(mechanics: PushMechanics, fit: JointFit, wide: JointFit, change: Change, ranked: list[Change]) -> Rung:
    """The rung with a change, refitted."""
    after = refit(mechanics, wide, _after(fit, change))
    gain = held_out_scores(fit) - held_out_scores(after)
    rivals = tuple(rival for rival in ranked if rival is not change)[:3]
    return Rung(after, change.added, change.dropped, float(gain.sum()), _error(gain), rivals)


def worthwhile(fit: JointFit, rung: Rung) -> bool:
    """Whether the gain of a rung after `fit` is large enough and, for more parameters, beyond its standard error."""
    more = len(rung.fit.names) > len(fit.names)
    least = _least(fit, Change(rung.added, rung.dropped))
    clear = CLEARLY * rung.error if more else 0.0
    return len(rung.fit.names) <= MOST_PARAMETERS and rung.gain > max(least, clear)


def _error(gain: Array) -> float:
    return float(np.sqrt(len(gain)) * gain.std(ddof=1))


FOLDS = 10


class CrossValidation:
    """Held-out predictions under choices among the parameters of a fit.

    Each fold's fit is one Gauss-Newton step from the joint one, with its weights and scale. A parameter of the fit that
    a choice lacks returns to its textbook value, to first order.
    """

    def __init__(self, fit: JointFit) -> None:
        self.fit = fit
        pushes = fit.rows.pushes
        fold = np.random.default_rng(0).permutation(pushes) % min(FOLDS, pushes)
        self.fold = fold[fit.rows.push]
        table = [BY_NAME[name] for name in fit.names]
        self._textbook = np.array([parameter.textbook for parameter in table])
        self._prior = np.array([parameter.spread for parameter in table]) ** -2.0
        self._values = np.array([fit.values[name] for name in fit.names])
        scaled = fit.residuals / fit.scale
        weight, bend = student_weights(scaled) / fit.scale**2, student_curvature(scaled) / fit.scale**2
        rows = [self.fold != k for k in range(int(self.fold.max()) + 1)]
        bent, pulls = fit.jacobian * bend[:, :, None], weight * fit.residuals
        grams = [np.tensordot(bent[~kept], fit.jacobian[~kept], ((0, 1), (0, 1))) for kept in rows]
        slopes = [np.einsum("nkp,nk->p", fit.jacobian[~kept], pulls[~kept]) for kept in rows]
        self._curvature = np.sum(grams, axis=0) - np.array(grams)
        self._slope = np.sum(slopes, axis=0) - np.array(slopes)

    def residuals(self, names: Sequence[str]) -> Array:
        """Residuals (n, 3) of each push under the parameters `names` fitted without its fold."""
        free = [self.fit.names.index(name) for name in names]
        dropped = [k for k in np.flatnonzero(self._values != self._textbook).tolist() if k not in free]
        change = np.zeros((len(self._slope), len(self.fit.names)))
        change[:, dropped] = (self._textbook - self._values)[dropped]
        if free:
            slope = self._slope[:, free] - np.einsum(
                "kfd,d->kf", self._curvature[:, free][:, :, dropped], change[0, dropped]
            )
            slope = slope + self._prior[free] * (self._textbook - self._values)[free]
            curvature = self._curvature[:, free][:, :, free] + np.diag(self._prior[free])
            change[:, free] = np.linalg.solve(curvature, slope[:, :, None])[:, :, 0]
        used = [*free, *dropped]
        explained = np.einsum("nkp,np->nk", self.fit.jacobian[:, :, used], change[self.fold][:, used])
        return np.asarray(self.fit.residuals - explained)

    def scores(self, names: Sequence[str]) -> Array:
        """Negative log density (pushes,) of each held-out push by Student's t, up to a constant."""
        density = student_loss(self.residuals(names) / self.fit.scale).sum(axis=1) + np.log(self.fit.scale).sum()
        return np.bincount(self.fit.rows.push, density).astype(np.float64)


def held_out_scores(fit: JointFit) -> Array:
    """Negative log density (pushes,) of each held-out push under the parameters of the fit, up to a constant."""
    return CrossValidation(fit).scores(fit.names)
