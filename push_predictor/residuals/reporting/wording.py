# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The verdict of a trace in sentences: the answer, its size with interval, and what it means for the model."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from push_predictor.evaluation.metrics import gaussian_nlpd
from push_predictor.evaluation.validation import Comparison
from push_predictor.recordings.table import OUTPUTS
from push_predictor.reporting.html import number
from push_predictor.residuals.evidence.drivers import UNDRIVEN
from push_predictor.residuals.outcome import FoundEffect, Gain, Trace, Verdict
from push_predictor.residuals.reporting.advice import grew_early
from push_predictor.residuals.reporting.input_shift import share_clause, shift_clause
from push_predictor.residuals.reporting.noise_ratio import noise_ratios
from push_predictor.residuals.reporting.phrases import (
    MECHANISMS,
    capitalised,
    covariate_phrase,
    listed,
    mechanism_phrase,
    moved_noun,
    step_phrase,
)
from push_predictor.residuals.reporting.quantities import count, estimate, in_shown_unit, p_text
from push_predictor.residuals.reporting.shift_size import shift_sizes

FURTHER = "In addition"
FORCE = "surface_friction"  # its size is a share of the force
UNVARIED = ("push_heading", "edge")  # covariates of constant effects that are fixed to the world or to the slider


def verdict_sentence(trace: Trace) -> str:
    """The verdict in a few sentences: answer, size, rivals."""
    return f"{_joined(headline(trace), EVIDENCE[trace.verdict](trace))}{rivals_sentence(trace)}"


def headline(trace: Trace) -> str:
    """The answer in one clause, without a full stop."""
    if trace.verdict == "none":
        return "No change found"
    if trace.verdict == "measurement":
        return "The measurement is wrong, not the motion model"
    if trace.verdict == "input_shift":
        return capitalised(shift_clause(trace.input_shift[0]))
    return capitalised(_claim(trace, 0))


def evidence_sentence(trace: Trace) -> str:
    """The sentences of the verdict between the headline and the rivals."""
    evidence = EVIDENCE[trace.verdict](trace)
    sized = trace.verdict not in ("none", "measurement", "input_shift") and not evidence.startswith("p = ")
    return f"Size: {evidence}" if sized else evidence if evidence.startswith("p = ") else capitalised(evidence)


def worth_sentence(trace: Trace) -> str:
    """What the finding means for the motion model, and the gain on held-out pushes."""
    pushes = count(len(trace.held_out.table.pushes), "held-out push", "held-out pushes")
    if trace.verdict == "measurement":
        return f"The motion model stays unchanged. Correct the measurement, then trace again.{_after_correction(trace)}"
    if trace.verdict == "input_shift":
        further = (
            "Train on pushes in the new range"
            if trace.input_shift[0].extrapolates
            else "Push in the rest of training's range"
        )
        return f"The motion model stays unchanged. {further}, then trace again."
    if not trace.terms:
        retrain = " Retrain on the new pushes to update the predicted noise." if trace.verdict == "variance" else ""
        return f"The motion model stays unchanged: no effect on the mean motion was found.{retrain}"
    if trace.gain_nlpd.low == trace.gain_nlpd.high == 0.0:  # a refit learns all effects that were found
        return (
            "Retraining on the new pushes fixes this. No extension is needed. "
            f"On {pushes} retraining changes the negative log density: it {_change(trace.held_out.before, trace)}."
        )
    return f"{_decision(trace)} {_gain(trace, pushes)}"


def _after_correction(trace: Trace) -> str:
    """How a correction of the streams changes the density; nothing if there were none to correct."""
    before, after = trace.held_out.before, trace.held_out.after
    if np.array_equal(before.mean, after.mean):
        return ""
    return f" With corrected streams the model's negative log density {_change(before, trace, 'after')}."


def _decision(trace: Trace) -> str:
    gain = trace.gain_nlpd
    if trace.extended is not None:
        return "The motion model is extended."
    if not np.isfinite([gain.low, gain.high]).all():
        return "The motion model stays unchanged: there are too few pushes for an interval."
    effects = "the effect does" if len(trace.effects) == 1 else "the effects do"
    return f"The motion model stays unchanged: {effects} not improve the log density beyond chance."


def _gain(trace: Trace, pushes: str) -> str:
    effects = "the effect changes" if len(trace.effects) == 1 else "the effects change"
    reference = "as deployed" if trace.gain_over == "deployed" else "retrained"
    return (
        f"On {pushes} {effects} the negative log density by {estimate(trace.gain_nlpd, 'nats per window')}. "
        f"The reference is the model {reference} without the effect. Below zero is better."
    )


def _change(first: Comparison, trace: Trace, second: str = "refit") -> str:
    last: Comparison = getattr(trace.held_out, second)
    return f"goes from {_nlpd(first)} to {_nlpd(last)} nats per window"


def _nlpd(comparison: Comparison) -> str:
    every = gaussian_nlpd(comparison.mean, comparison.variance, comparison.observed).sum(axis=1)
    return number(float(np.mean(every)) if len(every) else None)


def _joined(claim: str, evidence: str) -> str:
    """A claim and its evidence; a p value alone goes in brackets."""
    first, _, rest = evidence.partition(". ")
    first = first.removesuffix(".")
    sentence = f"{claim} ({first})." if first.startswith("p = ") else f"{claim}: {first}."
    return f"{sentence} {rest}".rstrip()


# --- the claim: what changed, and with what ------------------------------------------------------------------------


def _claim(trace: Trace, index: int) -> str:
    """What an effect is, in one clause: its mechanism and what it depends on."""
    effect = trace.effects[index]
    if trace.verdict == "variance":
        if effect.covariate in UNDRIVEN:
            return "the noise of the outcomes differs from training; the mean does not"
        return f"the noise of the outcomes changes with {covariate_phrase(effect.covariate)}; the mean does not"
    if effect.mechanism is None:
        how = "" if effect.covariate in UNDRIVEN else f", depending on {covariate_phrase(effect.covariate)}"
        closest = f" ({mechanism_phrase(effect.resembles)} comes closest)" if effect.resembles else ""
        return f"the slider moves differently than predicted{how}; no known mechanism fits{closest}"
    return f"{_moves(trace, index)}{'; the motion does not' if trace.verdict == 'wrench_only' else ''}"


def _moves(trace: Trace, index: int) -> str:
    """Subject and verb for a known mechanism, by the basis of its dependence."""
    effect = trace.effects[index]
    noun = moved_noun(effect.mechanism)
    if effect.covariate in UNDRIVEN or (effect.basis == "constant" and effect.covariate in UNVARIED):
        trained = trace.model.kind != "analytical" or trace.verdict == "wrench_only"  # the force is not part of a model
        return f"{noun} differs from {'training' if trained else 'the model'}"
    if effect.basis == "step" and index < len(trace.terms):
        known = MECHANISMS.get(effect.mechanism)
        onset = known.onset if known and known.onset else f"{noun} changed"
        return f"{onset} {step_phrase(effect.covariate, trace.terms[index].basis.place)}"
    if effect.basis == "category":
        return f"{noun} differs by {covariate_phrase(effect.covariate)}"
    along = "the position on the table" if effect.basis == "map" else covariate_phrase(effect.covariate)
    return f"{noun} changes with {along}"


# --- the evidence for each verdict ---------------------------------------------------------------------------------


def _none(trace: Trace) -> str:
    pushes = count(len(trace.analysis.pushes), "push", "pushes")
    tried = count(len(trace.tested), "candidate", "candidates")
    text = f"not one of {tried} explains the residual of {pushes} (family-wise level {number(trace.alpha)})."
    closest = min(trace.tested, key=lambda tested: tested.p_value, default=None)
    if closest is None:
        return text
    name = mechanism_phrase(closest.mechanism)
    depends = "" if closest.covariate in UNDRIVEN else f", depending on {covariate_phrase(closest.covariate)}"
    text = f"{text} The closest candidate is {name}{depends}, with p = {p_text(closest.p_value)}."
    if closest.p_value <= trace.alpha:
        text = f"{text} It is not significant: the level is divided among motion, force and measurement."
    return text


def _effects(trace: Trace) -> str:
    first, *others = (f"{_size(trace, k)}{_share(trace.effects[k])}" for k in range(len(trace.effects)))
    further = (f" {FURTHER}, {_joined(_claim(trace, k + 1), text)}" for k, text in enumerate(others))
    return "".join([first, *further])


def _size(trace: Trace, index: int) -> str:
    effect = trace.effects[index]
    if effect.parameter is None:
        return f"p = {p_text(effect.p_value)}.{_shift(trace, index)}"
    value, unit = in_shown_unit(effect.parameter)
    if effect.mechanism == FORCE:
        value, unit = Gain(100.0 * value.value, 100.0 * value.low, 100.0 * value.high), "%"
    return f"{estimate(value, unit, effect.p_value)}."


def _shift(trace: Trace, index: int) -> str:
    """By how much an unknown mechanism shifts the outcome."""
    if index >= len(trace.terms):
        return ""
    every = zip(shift_sizes(trace, trace.terms[index], trace.analysis), OUTPUTS, strict=True)
    outputs = trace.effects[index].outputs
    shifts = [f"{name} by {estimate(*in_shown_unit(size))}" for size, name in every if name in outputs]
    return f" It shifts {listed(shifts)}, root mean square." if shifts else ""


def _share(effect: FoundEffect) -> str:
    share = effect.share_of_residual
    return f" It explains {100.0 * share:.0f} % of the squared residual." if np.isfinite(share) and share > 0.0 else ""


def _measurement(trace: Trace) -> str:
    sizes = []
    for effect in trace.effects:
        if effect.parameter is not None:
            value, unit = in_shown_unit(effect.parameter)
            sizes.append(f"The {effect.parameter.name} is {estimate(value, unit, effect.p_value)}.")
    errors = listed([mechanism_phrase(name) for name in dict.fromkeys(e.mechanism for e in trace.effects)])
    return f"{errors}. {' '.join(sizes)}"


def _variance(trace: Trace) -> str:
    sentences = []
    for effect in trace.effects:
        sentences += [
            f"The noise of {name} is {estimate(ratio)} times as large in the highest fifth of "
            f"{covariate_phrase(effect.covariate)} as in the lowest."
            for name, ratio in noise_ratios(trace, effect).items()
        ]
    return " ".join([f"p = {p_text(trace.effects[0].p_value)}.", *sentences])


def _shifted(trace: Trace) -> str:
    """The share of windows that tell each input from training."""
    first, *others = trace.input_shift
    further = [f" {capitalised(shift_clause(shift))}: {share_clause(shift)}." for shift in others]
    return f"{share_clause(first)}.{''.join(further)}"


EVIDENCE: dict[Verdict, Callable[[Trace], str]] = {
    "none": _none,
    "effect": _effects,
    "driver_only": _effects,
    "mechanism_only": _effects,
    "wrench_only": _effects,
    "measurement": _measurement,
    "variance": _variance,
    "input_shift": _shifted,
}


def rivals_sentence(trace: Trace) -> str:
    """The covariates and mechanisms that fit as well."""
    text = ""
    if trace.effects and grew_early(trace.effects[0], trace.equivalent):
        text = " It was there from the first push, or it grew early in the session: these pushes do not decide."
    elif trace.equivalent:
        names = listed([covariate_phrase(name) for name in (trace.effects[0].covariate, *trace.equivalent)])
        text = f" {capitalised(names)} fit equally well."
    if trace.mechanisms:
        names = listed([mechanism_phrase(name) for name in trace.mechanisms])
        text += f" {capitalised(names)} would explain these pushes as well."
    return text
