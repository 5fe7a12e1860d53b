"""Forward selection of the forward model's parameters, by cross-validation over whole pushes: the ladder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.models.mechanics.fit import FitRows, JointFit, fit_jointly, held_out_scores, refit, with_candidates
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import PARAMETERS
from push_predictor.models.watch import Watch, no_watch
from push_predictor.types import Array

MOST_PARAMETERS = 12
LEAST_GAIN = 0.1  # nats per push: less is not worth a parameter
BEAM = 2  # ladders that are continued
FEWEST_PUSHES = 3  # of a cross-validation
CLEARLY = 1.0  # standard errors from push to push: the one standard error rule


@dataclass(frozen=True, eq=False)
class Rung:
    """A step of the ladder: the parameter that it adds, None for the textbook, and the joint fit with it.

    gain, error: of the held-out score when it was chosen, nats over all pushes, and its standard error from push to
    push. rivals: the next best parameters with their gains.
    """

    added: str | None
    fit: JointFit
    gain: float = 0.0
    error: float = 0.0
    rivals: tuple[tuple[str, float], ...] = ()


def climb(mechanics: PushMechanics, rows: FitRows, watch: Watch = no_watch) -> list[Rung]:
    """The rungs of the ladder, from the textbook's parameters on.

    Each step adds a parameter that improves the score of held-out pushes by more than one standard error of the gain
    from push to push, and refits all of them together. Two parameters can mimic a third for some steps, so the BEAM
    best ladders are continued at each step, and that with the best score wins. Candidates are all parameters whose
    covariates the rows have, and that the support and the data can show.
    """
    first = [Rung(None, fit_jointly(mechanics, rows, ()))]
    beam, ended = [first], [first]
    while beam and len(beam[0]) <= MOST_PARAMETERS and rows.pushes >= FEWEST_PUSHES:
        watch(f"fit mechanics: step {len(beam[0])}", min(0.8, 0.08 * len(beam[0])))
        promising = [step for rungs in beam for step in _promising(mechanics, rungs)]
        unlike = {
            frozenset((*step.wide_names, step.added)): step for step in sorted(promising, key=_expected, reverse=True)
        }
        beam = [step.taken(mechanics) for step in sorted(unlike.values(), key=_expected)[:BEAM]]
        ended += beam
    return min(ended, key=_score)


@dataclass(frozen=True, eq=False)
class _Step:
    """A parameter that a ladder may add. wide: the fit of its last rung with the derivatives of all candidates."""

    rungs: list[Rung]
    wide: JointFit
    added: str
    gain: float
    error: float
    rivals: tuple[tuple[str, float], ...]

    @property
    def wide_names(self) -> tuple[str, ...]:
        """Names of the parameters that are free already."""
        return self.rungs[-1].fit.names

    def taken(self, mechanics: PushMechanics) -> list[Rung]:
        """The ladder with the parameter, refitted."""
        fit = refit(mechanics, self.wide, (*self.wide_names, self.added))
        return [*self.rungs, Rung(self.added, fit, self.gain, self.error, self.rivals)]


def _expected(step: _Step) -> float:
    return _score(step.rungs) - step.gain


def _promising(mechanics: PushMechanics, rungs: list[Rung]) -> list[_Step]:
    """The BEAM best parameters that a ladder may add."""
    fit = rungs[-1].fit
    names = [name for name in candidates(mechanics, fit.rows) if name not in fit.names]
    wide = with_candidates(mechanics, fit, names)
    least = LEAST_GAIN * fit.rows.pushes
    gains = [(name, g, e) for name, g, e in _gains(wide, fit.names, names) if g > max(CLEARLY * e, least)]
    return [
        _Step(rungs, wide, name, gain, error, tuple((rival, value) for rival, value, _ in gains if rival != name)[:3])
        for name, gain, error in gains[:BEAM]
    ]


def _score(rungs: list[Rung]) -> float:
    """Negative log density of held-out pushes under the last rung, nats up to a constant."""
    fit = rungs[-1].fit
    return float(held_out_scores(fit, fit.names).sum() + len(fit.rows.push) * np.log(fit.scale).sum())


def candidates(mechanics: PushMechanics, rows: FitRows) -> list[str]:
    """Names of the parameters that these rows can show."""
    on_patch = mechanics.support is None and not _all_known(mechanics, rows)
    return [
        parameter.name
        for parameter in PARAMETERS
        if all(name in rows.covariates for name in parameter.needs)
        and (on_patch or parameter.name != "rim_exponent")
        and (len(np.unique(rows.inputs[:, 0])) > 1 or parameter.name not in ("clock_delay", "inertia"))
    ]


def _all_known(mechanics: PushMechanics, rows: FitRows) -> bool:
    recording = rows.covariates.get("recording")
    return recording is not None and set(np.unique(recording).tolist()) <= set(mechanics.supports)


def _gains(wide: JointFit, free: Sequence[str], names: Sequence[str]) -> list[tuple[str, float, float]]:
    """Names with the gain of the held-out score and its standard error, best first."""
    now = held_out_scores(wide, free)
    gains = [(name, now - held_out_scores(wide, (*free, name))) for name in names]
    return sorted(((name, float(gain.sum()), _error(gain)) for name, gain in gains), key=lambda g: -g[1])


def _error(gain: Array) -> float:
    return float(np.sqrt(len(gain)) * gain.std(ddof=1))
