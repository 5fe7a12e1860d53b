"""What a trace found, in sentences: size, unit and interval, for the page and for the terminal."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from push_predictor.evaluation.metrics import gaussian_nlpd
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.evaluation.validation import Comparison
from push_predictor.models.effects.effect import Effect, design_of
from push_predictor.models.mechanisms import Push
from push_predictor.models.request import UNITS
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.reporting.html import NOTHING, number
from push_predictor.residuals.evidence.drivers import CONSTANT
from push_predictor.residuals.evidence.standardised import physics_of
from push_predictor.residuals.outcome import FoundEffect, Gain, Sized, Trace, Verdict
from push_predictor.types import Array

DRAWS = 500
FIFTH = 0.2  # of the windows at either end of a driver, between which scatters are compared
SHOWN = {"m": (1e3, "mm"), "rad": (np.degrees(1.0), "deg"), "s": (1e3, "ms")}  # of sizes told in SI
OUTPUT_UNITS = dict(zip(OUTPUTS, ("m", "m", "rad"), strict=True))
UNKNOWN = "mechanism unknown"


def verdict_sentence(trace: Trace) -> str:
    """The verdict in one sentence."""
    sentence = SENTENCES[trace.verdict](trace)
    return sentence[0].upper() + sentence[1:]


def worth_sentence(trace: Trace) -> str:
    """What the effect is worth on held-out pushes, and whether the motion model was changed."""
    pushes = count(len(trace.held_out.table.pushes), "held-out push", "held-out pushes")
    if trace.verdict == "measurement":
        before, after = (_nlpd(comparison) for comparison in (trace.held_out.before, trace.held_out.after))
        change = f"the deployed model's negative log density goes from {before} to {after} nats per window"
        return f"The motion model stays as it is. With the measurement put right where recordings allow it, {change}."
    if not trace.terms:
        return f"The motion model stays as it is; on {pushes} nothing was added to the refit."
    gain = trace.gain_nlpd
    if gain.low == gain.high == 0.0:  # nothing was added to the refit
        before, refit = (_nlpd(comparison) for comparison in (trace.held_out.before, trace.held_out.refit))
        change = f"On {pushes} training anew takes the negative log density from {before} to {refit} nats per window"
        return f"{change}. What was found lies in the model's own inputs: that is enough, and the model stays as it is."
    change = (
        f"On {pushes} the negative log density changes by {interval(gain)} nats per window against the same model "
        f"refitted without the effect (below zero: better)"
    )
    if trace.extended is not None:
        return f"{change}. The interval lies wholly below zero, so the motion model is extended."
    if not np.isfinite([gain.low, gain.high]).all():
        return f"{change}. There are too few pushes for an interval, so the motion model stays as it is."
    if gain.high < 0.0:  # another rule than the gain's stands against it
        return f"{change}. The motion model stays as it is all the same: see the notes."
    return f"{change}. The interval does not lie wholly below zero: found, but not worth modelling; the model stays."


def _nlpd(comparison: Comparison) -> str:
    every = gaussian_nlpd(comparison.mean, comparison.variance, comparison.observed).sum(axis=1)
    return number(float(np.mean(every)) if len(every) else None)


def mechanism_words(mechanism: str | None) -> str:
    """A mechanism's name in words."""
    return UNKNOWN if mechanism is None else mechanism.replace("_", " ")


def driver_words(covariate: str, basis: str | None = None) -> str:
    """What drives an effect."""
    if covariate == CONSTANT:
        return "constant, driven by nothing recorded"
    return f"driven by {covariate}" if basis is None else f"driven by {covariate} ({basis})"


def size_words(size: Sized) -> str:
    """A parameter with unit and interval, in the units that people use."""
    factor, unit = SHOWN.get(size.unit, (1.0, size.unit))
    told = interval(Gain(*(factor * value for value in (size.value, size.low, size.high))))
    return f"{size.name} {told}" if unit in ("", "1") else f"{size.name} {told} {unit}"


def interval(gain: Gain, digits: int = 3) -> str:
    """A number with its 95 % interval; dashes for what is not determined."""
    value, low, high = (number(v if np.isfinite(v) else None, digits) for v in (gain.value, gain.low, gain.high))
    return value if NOTHING in (low, high) else f"{value} (95 %: {low} to {high})"


def count(n: int, one: str, many: str) -> str:
    """A number of things."""
    return f"{n} {one if n == 1 else many}"


def p_words(p: float) -> str:
    """A family-wise p value."""
    return number(p, 2)


def shift_sizes(trace: Trace, effect: Effect, table: PushTable) -> tuple[Sized, ...]:
    """Root mean square, over the windows of a table, by which the effect shifts each output (m, m, rad).

    The interval holds the central 95 % of draws of its coefficients.
    """
    push = Push(table.inputs, table.duration, table.covariates)
    square = _mean_square(trace, effect, push)
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal(effect.coefficients, effect.covariance, DRAWS, method="svd")
    spread = np.sqrt(np.maximum(np.einsum("da,kab,db->dk", draws, square, draws), 0.0))
    value = np.sqrt(np.maximum(np.einsum("a,kab,b->k", effect.coefficients, square, effect.coefficients), 0.0))
    low, high = np.quantile(spread, [0.025, 0.975], axis=0)
    ends = zip(OUTPUTS, value.tolist(), low.tolist(), high.tolist(), strict=True)
    return tuple(Sized(f"root mean square shift of {o}", v, a, b, OUTPUT_UNITS[o]) for o, v, a, b in ends)


def _mean_square(trace: Trace, effect: Effect, push: Push) -> Array:
    """Of each output, mean over the windows of the square of the design: (3, q, q)."""
    physics = physics_of(trace.model)
    design = design_of(effect.mechanism, effect.basis, physics, push, effect.outcome_scale)
    return np.asarray(np.einsum("nka,nkb->kab", design, design) / max(len(design), 1))


def _none(trace: Trace) -> str:
    strongest = min(trace.tested, key=lambda tested: tested.p_value, default=None)
    nearest = ""
    if strongest is not None:
        what = f"{mechanism_words(strongest.mechanism)}, {driver_words(strongest.covariate)}"
        shared = (
            " (the level is shared among motion, force and measurement)" if strongest.p_value <= trace.alpha else ""
        )
        nearest = f"; the nearest was {what}, with p = {p_words(strongest.p_value)}{shared}"
    return (
        f"Nothing found: of {count(len(trace.tested), 'candidate', 'candidates')} none explains the residual of "
        f"{count(len(trace.analysis.pushes), 'push', 'pushes')} at the family-wise level of {number(trace.alpha)}"
        f"{nearest}."
    )


def _found(trace: Trace) -> str:
    told = "; and ".join(_effect(trace, k) for k in range(len(trace.effects)))
    return f"The model lacks {count(len(trace.effects), 'effect', 'effects')}: {told}."


def _driver_only(trace: Trace) -> str:
    first = trace.effects[0]
    how = "is another than the model says" if first.covariate == CONSTANT else f"changes with {first.covariate}"
    return f"The motion {how}, by a mechanism that the library does not hold: {_effect(trace, 0)}."


def _mechanism_only(trace: Trace) -> str:
    first, rivals = trace.effects[0], ", ".join(trace.equivalent)
    return (
        f"{mechanism_words(first.mechanism)} is not as the model has it, but these data cannot tell whether "
        f"{first.covariate} drives it or {rivals}: {_effect(trace, 0)}."
    )


def _wrench(trace: Trace) -> str:
    return f"The force changed and the motion did not; the motion model is left alone: {_all(trace)}."


def _measurement(trace: Trace) -> str:
    return f"The measurement is off, not the motion: {_all(trace)}."


def _variance(trace: Trace) -> str:
    return f"The scatter changes and the mean does not: {_all(trace)}."


def _all(trace: Trace) -> str:
    return "; and ".join(_effect(trace, k) for k in range(len(trace.effects)))


def _effect(trace: Trace, index: int) -> str:
    effect = trace.effects[index]
    sizes = [] if effect.parameter is None else [size_words(effect.parameter)]
    if trace.verdict == "variance":
        sizes = _scatter(trace, effect)
    elif not sizes and index < len(trace.terms):
        every = shift_sizes(trace, trace.terms[index], trace.analysis)
        sizes = [size_words(size) for size, name in zip(every, OUTPUTS, strict=True) if name in effect.outputs]
    driver = [] if trace.verdict == "measurement" else [driver_words(effect.covariate, effect.basis)]
    named = [] if trace.verdict == "variance" else [mechanism_words(effect.mechanism)]
    told = [*named, *driver, *sizes, *_share(effect), f"p = {p_words(effect.p_value)}"]
    return ", ".join(told)


def _scatter(trace: Trace, effect: FoundEffect) -> list[str]:
    """Root mean square of the residual in the highest fifth of the driver over that in the lowest."""
    values = trace.analysis.covariates.get(effect.covariate)
    if values is None or len(trace.unexplained) != len(values):
        return []
    low, high = (values <= np.quantile(values, FIFTH)), (values >= np.quantile(values, 1.0 - FIFTH))
    weights = np.vstack([np.ones(len(values)), push_bootstrap(trace.analysis.push_id)])
    told = []
    for name in effect.outputs:
        square = trace.unexplained[:, OUTPUTS.index(name)] ** 2
        spread = [np.sqrt(weights @ (square * rows) / np.maximum(weights @ rows, 1.0)) for rows in (low, high)]
        ratio = spread[1] / np.maximum(spread[0], np.finfo(float).tiny)
        ends = np.quantile(ratio[1:], [0.025, 0.975])
        told.append(
            f"scatter of {name} {interval(Gain(float(ratio[0]), *map(float, ends)))} times as large high as low"
        )
    return told


def _share(effect: FoundEffect) -> list[str]:
    share = effect.share_of_residual
    return [f"{100.0 * share:.0f} % of the residual's sum of squares"] if np.isfinite(share) and share > 0.0 else []


SENTENCES: dict[Verdict, Callable[[Trace], str]] = {
    "none": _none,
    "effect": _found,
    "driver_only": _driver_only,
    "mechanism_only": _mechanism_only,
    "wrench_only": _wrench,
    "measurement": _measurement,
    "variance": _variance,
}


def unit_of(covariate: str) -> str:
    """The unit of a driver, empty where none is known."""
    return UNITS.get(covariate, "")
