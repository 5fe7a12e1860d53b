# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The answer of a trace in three sentences: what changed and since when or where, how big it is, what to do."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from push_predictor.evaluation.report.tables import paired_difference
from push_predictor.evaluation.validation import metrics_json
from push_predictor.models.effects.effect import Effect
from push_predictor.residuals.evidence.drivers import UNDRIVEN
from push_predictor.residuals.outcome import FoundEffect, Gain, Sized, Trace
from push_predictor.residuals.reporting.advice import ANEW, grew_early
from push_predictor.residuals.reporting.input_shift import share_clause
from push_predictor.residuals.reporting.noise_ratio import noise_ratios
from push_predictor.residuals.reporting.phrases import capitalised, covariate_phrase, listed, mechanism_phrase
from push_predictor.residuals.reporting.quantities import count, estimate, in_shown_unit, shown_unit
from push_predictor.residuals.reporting.shift_size import shift_sizes
from push_predictor.residuals.reporting.wording import FORCE, headline

MOST_NAMES = 3  # rivals that one sentence lists
USUAL = "contact_friction"  # the mechanism whose detectable size is shown if nothing was found
REMEDIES = {
    "clock_offset": "Synchronise the clocks of tracker and robot",
    "frame_rotation": "Calibrate the tracker's frame again",
    "frame_shift": "Calibrate the tracker's frame again",
    "tool_offset": "Measure the tool point again",
    "wrench_bias": "Zero the force sensor",
}


def answer(trace: Trace) -> tuple[str, str, str]:
    """What changed and since when or where, how big it is, what to do: one sentence each."""
    return _change(trace), _SIZES.get(trace.verdict, _size)(trace), _ACTIONS.get(trace.verdict, _action)(trace)


# --- what changed ----------------------------------------------------------------------------------------------------


def _change(trace: Trace) -> str:
    if trace.verdict == "measurement":
        errors = listed([mechanism_phrase(name) for name in dict.fromkeys(e.mechanism for e in trace.effects)])
        return f"{headline(trace)}: {errors}."
    more = min(len(trace.terms), len(trace.effects)) - 1
    further = f", and {count(more, 'further change was', 'further changes were')} found" if more > 0 else ""
    return f"{headline(trace)}{further}."


# --- how big ---------------------------------------------------------------------------------------------------------


def _size(trace: Trace) -> str:
    """The first effect's parameter, and how far it shifts a window."""
    effect = trace.effects[0]
    size = None if effect.parameter is None else f"The {_parameter_clause(effect.parameter)}"
    if not trace.terms:
        return f"{size or 'Its size is unknown'}."
    shift = _shift_clause(trace, trace.terms[0])
    return f"{size}; {shift}." if size else f"{capitalised(shift.replace('that is', 'the slider moves off by'))}."


def _parameter_clause(size: Sized) -> str:
    return f"{size.name.partition(', ')[0]} is {estimate(*in_shown_unit(size))}"


def _shift_clause(trace: Trace, effect: Effect) -> str:
    """How far an effect moves the slider in a window: root mean square of the position and of the heading."""
    x, y, turn = (size.value for size in shift_sizes(trace, effect, trace.analysis))
    seconds = float(np.median(trace.analysis.duration))
    return f"in {seconds:.2g} s that is {1e3 * np.hypot(x, y):.2g} mm and {np.degrees(turn):.2g} deg"


def _size_of_none(trace: Trace) -> str:
    """The smallest effect that would have been found."""
    name = USUAL if USUAL in trace.minimum_detectable else next(iter(trace.minimum_detectable), None)
    value = None if name is None else trace.minimum_detectable[name].get("value")
    if name is None or value is None:
        return f"Not one of {count(len(trace.tested), 'candidate', 'candidates')} explains the errors of these pushes."
    factor, unit = shown_unit(str(trace.minimum_detectable[name].get("unit", "")))
    size = f"{factor * float(value):.2g} {unit}".strip()
    return f"A change of {mechanism_phrase(name)} by {size} would have been found with 80 % probability."


def _size_of_force(trace: Trace) -> str:
    size = trace.effects[0].parameter
    if size is None:
        return "Its size is unknown."
    if trace.effects[0].mechanism != FORCE:
        return f"The {_parameter_clause(size)}."
    covariate = trace.effects[0].covariate
    if covariate in UNDRIVEN:
        low, high = sorted(abs(end) for end in (size.low, size.high))
        share = estimate(Gain(100.0 * abs(size.value), 100.0 * low, 100.0 * high), "%")
        return f"It is {share} {'larger' if size.value > 0.0 else 'smaller'} than in training."
    share = estimate(Gain(100.0 * size.value, 100.0 * size.low, 100.0 * size.high), "%")
    return f"It changes by {share} over the range of {covariate_phrase(covariate)}."


def _size_of_measurement(trace: Trace) -> str:
    sizes = [_parameter_clause(e.parameter) for e in trace.effects[:2] if e.parameter is not None]
    return f"The {listed(sizes)}." if sizes else "Its size is unknown."


def _size_of_noise(trace: Trace) -> str:
    effect = trace.effects[0]
    ratios = noise_ratios(trace, effect)
    if not ratios:
        return "Its size is unknown."
    name, ratio = max(ratios.items(), key=lambda pair: abs(np.log(max(pair[1].value, 1e-9))))
    along = covariate_phrase(effect.covariate)
    return (
        f"From the lowest to the highest fifth of {along}, the noise of {name} changes by the factor {estimate(ratio)}."
    )


def _size_of_shift(trace: Trace) -> str:
    first, *others = trace.input_shift
    more = f"; {count(len(others), 'further input has', 'further inputs have')} shifted as well" if others else ""
    return f"{share_clause(first)}{more}."


_SIZES: dict[str, Callable[[Trace], str]] = {
    "none": _size_of_none,
    "wrench_only": _size_of_force,
    "measurement": _size_of_measurement,
    "variance": _size_of_noise,
    "input_shift": _size_of_shift,
}


# --- what to do ------------------------------------------------------------------------------------------------------


def _action(trace: Trace) -> str:
    model, reason = _model_clause(trace)
    if not trace.equivalent:
        return f"{model}: {reason}."
    if grew_early(trace.effects[0], trace.equivalent):
        return f"{model}. {ANEW}"
    names = _rivals(trace.effects[0], trace.equivalent)
    return f"{model}, and vary {names} independently: these pushes do not separate them."


def _model_clause(trace: Trace) -> tuple[str, str]:
    """Which model to use, and why."""
    gain = trace.gain_nlpd
    pushes = count(len(trace.held_out.table.pushes), "held-out push", "held-out pushes")
    if trace.extended is not None:
        return "Use the extended model", f"on {pushes} {_improvement(trace)}"
    if gain.low == gain.high == 0.0:
        return "Retrain the model on the new pushes", "that is enough, and no extension is needed"
    if _retraining_helps(trace):
        return "Retrain the model on the new pushes", "that lowers the errors, and the extension adds nothing certain"
    found = "the effect does" if len(trace.effects) == 1 else "the effects do"
    return "Keep the deployed model", f"on {pushes} {found} not improve the predictions beyond chance"


def _retraining_helps(trace: Trace) -> bool:
    """Whether the refit predicts held-out pushes better than the deployed model, beyond chance."""
    before, refit = trace.held_out.before, trace.held_out.refit
    return bool(len(before.observed)) and bool(paired_difference(before, refit)[1][2] < 0.0)


def _improvement(trace: Trace) -> str:
    """By how much the extended model is better than the better of the two without the effects."""
    reference = trace.held_out.before if trace.gain_over == "deployed" else trace.held_out.refit
    every: list[dict[str, Any]] = [metrics_json(c) for c in (reference, trace.held_out.after)]
    without, after = (metrics["nmse"]["total"] for metrics in every)
    other = "that of the deployed model" if trace.gain_over == "deployed" else "after retraining alone"
    if without and after is not None and after < without:
        return f"its squared error is {100.0 * (1.0 - after / without):.0f} % lower than {other}"
    return f"its log density is {-trace.gain_nlpd.value:.2g} nats per window higher than {other}"


def _rivals(effect: FoundEffect, equivalent: tuple[str, ...]) -> str:
    names = [covariate_phrase(name) for name in (effect.covariate, *equivalent)]
    if len(names) > MOST_NAMES:
        return f"{names[0]} and {len(names) - 1} rivals"
    return listed(names)


def _action_on_measurement(trace: Trace) -> str:
    remedy = REMEDIES.get(str(trace.effects[0].mechanism), "Correct the measurement")
    return f"{remedy}, then record and trace again: the motion model stays as it is."


_ACTIONS: dict[str, Callable[[Trace], str]] = {
    "none": lambda _: "Keep the deployed model: no action is needed.",
    "wrench_only": lambda _: "Keep the motion model: only what uses the force needs the new value.",
    "measurement": _action_on_measurement,
    "variance": lambda _: "Retrain the model on the new pushes, so that it predicts the new noise.",
    "input_shift": lambda trace: (
        "Train on pushes in the new range, then trace again: outside its range a model extrapolates."
        if trace.input_shift[0].extrapolates
        else "Keep the deployed model, and push in the rest of its range, too: there these pushes show nothing."
    ),
}
