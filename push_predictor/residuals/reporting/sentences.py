# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A trace in sentences: what changed, how large it is, what to do; then evidence, held-out gain, rivals and advice."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, floor, log10

import numpy as np

from push_predictor.evaluation.estimate import Estimate, difference_by_push, total_nlpd, total_nmse
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.evaluation.validation import Comparison
from push_predictor.models.effects.covariates import CUMULATIVE, HEADINGS
from push_predictor.reporting.html import NOTHING, count, number
from push_predictor.residuals.evidence.drivers import UNDRIVEN
from push_predictor.residuals.evidence.input_shift import ShiftedInput
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting import phrases as say
from push_predictor.residuals.reporting.phrases import detectable, effect_phrase, effect_size, parameter

MOST_NAMES = 3  # rivals that one sentence lists
MOST_TIMES = 100.0  # as many pushes; an estimate of more is none
UNVARIED = ("push_heading", "edge")  # covariates of constant effects that are fixed to the world or to the slider
ACTIONS = {
    "none": "Keep the deployed model: no action is needed",
    "wrench_only": "Keep the motion model: only what uses the force needs the new value",
    "variance": "Retrain the model on the new pushes, so that it predicts the new noise",
}
REMEDIES = {
    "clock_offset": "Synchronise the clocks of tracker and robot",
    "frame_rotation": "Calibrate the tracker's frame again",
    "frame_shift": "Calibrate the tracker's frame again",
    "tool_offset": "Measure the tool point again",
    "wrench_bias": "Zero the force sensor",
}
ANEW = "To decide, restore the rig to its state at the start of the session, and push again"
HEADED = (*HEADINGS, "edge")
ADVICE: tuple[tuple[tuple[str, ...], tuple[str, ...], str], ...] = (  # for two rivals, one of each group
    (
        CUMULATIVE,
        CUMULATIVE,
        "Pause for about half a session, then continue: time passes, push count and distance do not. Then alternate "
        "blocks of short and of long pushes: in long pushes the distance grows faster than the count.",
    ),
    (
        CUMULATIVE,
        ("slider_x", "slider_y"),
        "Return to places where the slider was early on: an effect of the place recurs, a drift does not.",
    ),
    (
        HEADED,
        HEADED,
        "Place the slider at many headings, and push every side at each heading. That separates the side, the slider's "
        "heading and the push direction.",
    ),
    (CUMULATIVE, ("velocity", "angle", "contact"), "Randomise speed, push angle and contact point over the session."),
    (CUMULATIVE, ("dwell_time",), "Randomise the pause before each push over the session."),
    (
        CUMULATIVE,
        ("recording",),
        "Repeat the setting of an early recording in a new one: an effect of the setting recurs, a drift does not.",
    ),
)


def answer(trace: Trace) -> tuple[str, str, str]:
    """What changed and since when or where, how large it is, what to do: one sentence each."""
    return f"{_change(trace)}.", f"{say.capitalised(_size(trace))}.", f"{_action(trace)}."


def evidence(trace: Trace) -> str:
    """Every effect with its size, intervals and p value; if there is none, what comes closest."""
    if trace.verdict == "none":
        return _closest(trace)
    if trace.verdict == "input_shift":
        return " ".join(shift_sentence(shift) for shift in trace.input_shift)
    return " ".join(_evidence_of(trace, k) for k in range(len(trace.effects)))


def worth(trace: Trace) -> str:
    """The gain on held-out pushes, and how many would settle it; empty if nothing could be gained."""
    gain, pushes = trace.confirming_gain, _held_out_pushes(trace)
    if trace.verdict == "measurement" and not np.array_equal(trace.held_out.before.mean, trace.held_out.after.mean):
        values = (float(total_nlpd(push_scores(c).totals())[0]) for c in (trace.held_out.before, trace.held_out.after))
        change = " to ".join(map(number, values))
        return f"With corrected streams the model's negative log density goes from {change} nats per window."
    if not trace.terms:
        return ""
    if trace.relearnt:
        text = f"On {pushes} retraining changes the squared error (total NMSE) by {say.interval(gain)}."
    else:
        effects = "the effects change" if len(trace.effects) > 1 else "the effect changes"
        reference = "as deployed" if trace.gain_over == "deployed" else "retrained"
        text = (
            f"On {pushes} {effects} the negative log density by {say.interval(gain, 'nats per window')}. "
            f"The reference is the model {reference} without the effect."
        )
    return f"{text} Below zero is better.{_needed_pushes(trace)}"


def shift_sentence(shift: ShiftedInput) -> str:
    """Where an input is now and where it was in training, and the share of windows outside."""
    return f"{say.capitalised(_shift_clause(shift))}: {_share_clause(shift)}."


# --- what changed ----------------------------------------------------------------------------------------------------


def _change(trace: Trace) -> str:
    if trace.verdict == "none":
        return "No change found"
    if trace.verdict == "measurement":
        errors = dict.fromkeys(effect.mechanism for effect in trace.effects)
        return f"The measurement is wrong, not the motion model: {say.listed([*map(say.mechanism_phrase, errors)])}"
    if trace.verdict == "input_shift":
        return say.capitalised(_shift_clause(trace.input_shift[0]))
    more = min(len(trace.terms), len(trace.effects)) - 1
    further = f", and {count(more, 'further change was', 'further changes were')} found" if more > 0 else ""
    return say.capitalised(f"{'weak evidence: ' if trace.weak else ''}{_claim(trace, 0)}{further}")


def _claim(trace: Trace, index: int) -> str:
    """What an effect is, in one clause: its mechanism and what it depends on."""
    effect = trace.effects[index]
    if trace.verdict == "variance":
        if effect.covariate in UNDRIVEN:
            return "the noise of the outcomes differs from training; the mean does not"
        return f"the noise of the outcomes changes with {say.covariate_phrase(effect.covariate)}; the mean does not"
    if effect.mechanism is None:
        how = "" if effect.covariate in UNDRIVEN else f", depending on {say.covariate_phrase(effect.covariate)}"
        closest = f" ({say.mechanism_phrase(effect.resembles)} comes closest)" if effect.resembles else ""
        return f"the slider moves differently than predicted{how}; no known mechanism fits{closest}"
    return f"{_moves(trace, index)}{'; the motion does not' if trace.verdict == 'wrench_only' else ''}"


def _moves(trace: Trace, index: int) -> str:
    """Subject and verb for a known mechanism, by the basis of its dependence."""
    effect = trace.effects[index]
    noun = say.mechanism_phrase(effect.mechanism)
    if effect.covariate in UNDRIVEN or (effect.basis == "constant" and effect.covariate in UNVARIED):
        trained = trace.model.kind != "analytical" or trace.verdict == "wrench_only"  # the force is not part of a model
        return f"{noun} differs from {'training' if trained else 'the model'}"
    if effect.basis == "step" and index < len(trace.terms):
        known = say.MECHANISMS.get(str(effect.mechanism))
        onset = known.onset if known and known.onset else f"{noun} changed"
        return f"{onset} {say.step_phrase(effect.covariate, trace.terms[index].basis.place)}"
    if effect.basis == "category":
        return f"{noun} differs by {say.covariate_phrase(effect.covariate)}"
    along = "the position on the table" if effect.basis == "map" else say.covariate_phrase(effect.covariate)
    return f"{noun} changes with {along}"


def _shift_clause(shift: ShiftedInput) -> str:
    factor, unit = say.shown_unit_of(shift.covariate)
    now, before = (
        f"{number(factor * float(low), 3)} to {number(factor * float(high), 3)} {unit}".rstrip()
        for low, high in (shift.now, shift.training)
    )
    return f"{say.covariate_phrase(shift.covariate)} is now {now}, in training {before}"


def _share_clause(shift: ShiftedInput) -> str:
    if not shift.extrapolates:
        return f"{100.0 * shift.share_unvisited:.0f} % of the training windows lie outside the range of the new pushes"
    return f"{100.0 * shift.share_outside:.0f} % of the windows lie outside the range of training"


# --- how large -------------------------------------------------------------------------------------------------------


def _size(trace: Trace) -> str:
    if trace.verdict == "none":
        return detectable(trace)
    if trace.verdict == "input_shift":
        more = len(trace.input_shift) - 1
        also = f"; {count(more, 'further input has', 'further inputs have')} shifted as well" if more else ""
        return f"{_share_clause(trace.input_shift[0])}{also}"
    if not trace.terms:
        return f"the {say.listed([parameter(e) for e in trace.effects[:2] if e.parameter] or ['size is unknown'])}"
    return f"it {effect_size(trace, 0)}"


# --- what to do ------------------------------------------------------------------------------------------------------


def _action(trace: Trace) -> str:
    if trace.verdict in ACTIONS:
        return ACTIONS[trace.verdict]
    if trace.verdict == "measurement":
        remedy = REMEDIES.get(str(trace.effects[0].mechanism), "Correct the measurement")
        return f"{remedy}, then record and trace again: the motion model stays as it is"
    if trace.verdict == "input_shift":
        if trace.input_shift[0].extrapolates:
            return "Train on pushes in the new range, then trace again: outside its range a model extrapolates"
        return "Keep the deployed model, and push in the rest of its range, too: there these pushes show nothing"
    model, reason = _model(trace)
    if not trace.equivalent:
        return f"{model}: {reason}"
    if grew_early(trace):
        return f"{model}. {ANEW}"
    names = [say.covariate_phrase(name) for name in (trace.effects[0].covariate, *trace.equivalent)]
    every = f"{names[0]} and {len(names) - 1} rivals" if len(names) > MOST_NAMES else say.listed(names)
    return f"{model}, and vary {every} independently: these pushes do not separate them"


def _model(trace: Trace) -> tuple[str, str]:
    """Which model to use, and why."""
    held, pushes = trace.held_out, _held_out_pushes(trace)
    if trace.extended is not None:
        return "Use the extended model", f"on {pushes} {_improvement(trace)}"
    if not np.isfinite(trace.confirming_gain.high):
        return "Keep the deployed model", "there are too few pushes for an interval"
    if trace.relearnt and not trace.weak:
        return "Retrain the model on the new pushes", "that is enough, and no extension is needed"
    if not trace.relearnt and _difference(held.before, held.refit).high < 0.0:
        return "Retrain the model on the new pushes", "that lowers the errors, and the extension adds nothing certain"
    what = "retraining does" if trace.relearnt else "the effect does" if len(trace.effects) == 1 else "the effects do"
    return "Keep the deployed model", f"on {pushes} {what} not improve the predictions beyond chance"


def _improvement(trace: Trace) -> str:
    """By how much the extended model is better than the better of the two without the effects."""
    deployed = trace.gain_over == "deployed"
    first = trace.held_out.before if deployed else trace.held_out.refit
    without, after = (float(total_nmse(push_scores(c).totals())[0]) for c in (first, trace.held_out.after))
    other = "that of the deployed model" if deployed else "after retraining alone"
    if after < without:
        return f"its squared error is {100.0 * (1.0 - after / without):.0f} % lower than {other}"
    return f"its log density is {-trace.gain_nlpd.value:.2g} nats per window higher than {other}"


# --- evidence and held-out gain --------------------------------------------------------------------------------------


def _evidence_of(trace: Trace, index: int) -> str:
    effect = trace.effects[index]
    size = f"The {parameter(effect, effect.p_value)}." if effect.parameter else ""
    if trace.verdict == "measurement":
        return size or "Its size is unknown."
    claim = _claim(trace, index)
    claim = f"In addition, {claim}" if index else say.capitalised(claim)
    claim = claim if size else f"{claim} (p = {say.p_text(effect.p_value)})"
    if index >= len(trace.terms):
        return f"{claim}. {size}".rstrip()
    share = effect.share_of_residual
    known = np.isfinite(share) and share > 0.0
    explains = f" It explains {100.0 * share:.0f} % of the squared residual." if known else ""
    return f"{claim}. It {effect_size(trace, index, effect.p_value)}.{explains}"


def _closest(trace: Trace) -> str:
    pushes = count(len(trace.analysis.pushes), "push", "pushes")
    tried = count(len(trace.tested), "candidate", "candidates")
    text = f"Not one of {tried} explains the residual of {pushes} (family-wise level {number(trace.alpha)})."
    harmless = {each.mechanism for each in trace.harmless}
    others = (tested for tested in trace.tested if tested.mechanism not in harmless)
    closest = min(others, key=lambda tested: tested.p_value, default=None)
    if closest is None:
        return text
    depends = "" if closest.covariate in UNDRIVEN else f", depending on {say.covariate_phrase(closest.covariate)}"
    name = f"{say.mechanism_phrase(closest.mechanism)}{depends}"
    return f"{text} The closest candidate is {name}, with p = {say.p_text(closest.p_value)}."


def _needed_pushes(trace: Trace) -> str:
    """How many pushes would make a gain certain: its interval shrinks with the root of their number."""
    gain = trace.confirming_gain
    if not trace.weak or not gain.value < 0.0 or not np.isfinite(gain.high):
        return ""
    times = ((gain.high - gain.value) / -gain.value) ** 2
    if times > MOST_TIMES:
        return f" To confirm so small a gain, more than {MOST_TIMES:.0f} times as many pushes are needed."
    held = len(trace.held_out.table.pushes)
    needed, now = times * (held + len(trace.analysis.pushes)), held + len(trace.analysis.pushes)
    unit = 10.0 ** max(0, floor(log10(needed)) - 1)  # two digits
    return f" If the gain stays the same, some {unit * ceil(needed / unit):.0f} pushes would confirm it (now {now})."


def _held_out_pushes(trace: Trace) -> str:
    return count(len(trace.held_out.table.pushes), "held-out push", "held-out pushes")


def _difference(first: Comparison, second: Comparison) -> Estimate:
    return difference_by_push(push_scores(first), push_scores(second), total_nlpd)


def rivals(trace: Trace) -> str:
    """The covariates and mechanisms that fit as well; empty without any."""
    found = []
    if trace.effects and grew_early(trace):
        found.append("It was there from the first push, or it grew early in the session.")
    elif trace.equivalent:
        names = [say.covariate_phrase(name) for name in (trace.effects[0].covariate, *trace.equivalent)]
        found.append(f"{say.capitalised(say.listed(names))} fit equally well.")
    if trace.mechanisms:
        names = [say.mechanism_phrase(name) for name in trace.mechanisms]
        found.append(f"{say.capitalised(say.listed(names))} would explain these pushes as well.")
    if found:
        one = "The first fits best, but these data do not exclude the others."
        found.append("These data do not decide." if trace.undecided else one)
    return " ".join(found)


def advice(trace: Trace) -> list[str]:
    """How to push so that the rival covariates separate; empty without rivals."""
    if not trace.equivalent:
        return []
    if grew_early(trace):
        return [f"{ANEW}."]
    return separating_words((trace.effects[0].covariate, *trace.equivalent))


def separating_words(names: Sequence[str]) -> list[str]:
    """How to push so that these covariates separate."""
    known = {*names}
    found = [
        text for one, other, text in ADVICE if len({*one, *other} & known) > 1 and {*one} & known and {*other} & known
    ]
    every = say.listed([say.covariate_phrase(name) for name in names])
    return found or [f"Vary {every} independently: change one while the others stay constant."]


def grew_early(trace: Trace) -> bool:
    """Whether all that rivals a constant effect is that it grew early in the session."""
    first = trace.effects[0]
    return first.basis == "constant" and bool(trace.equivalent) and {*trace.equivalent} <= {*CUMULATIVE}


def summary_lines(trace: Trace) -> list[str]:
    """The page's answer, its evidence, held-out figures and notes; plain ASCII."""
    details = filter(None, (evidence(trace), rivals(trace), *advice(trace), worth(trace)))
    held = f"Held out: {len(trace.held_out.table.pushes)} pushes, SHA-256 {trace.held_out.digest}"
    lines = [*answer(trace), "", *details, "", held, *map(_scores, trace.comparisons)]
    if trace.remaining is not None:
        lines.append(f"Still significant after these effects: {effect_phrase(*trace.remaining)}.")
    lines += [f"Note: {note}" for note in trace.notes]
    return [line.replace("−", "-").replace(NOTHING, "-") for line in lines]


def _scores(comparison: Comparison) -> str:
    totals = push_scores(comparison).totals()
    squared, density = (float(figure(totals)[0]) for figure in (total_nmse, total_nlpd))
    return f"{comparison.model:8s}NMSE {number(squared, 3)}, NLPD {number(density, 3)} nats per window"
