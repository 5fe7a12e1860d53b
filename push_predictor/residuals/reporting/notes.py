# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Notes of a trace: what a reader must know in addition to the verdict, in sentences."""

from __future__ import annotations

from collections.abc import Sequence

from push_predictor.residuals.channel_search import Searched
from push_predictor.residuals.channels.motion import MotionFinding
from push_predictor.residuals.outcome import Sized
from push_predictor.residuals.question import Question
from push_predictor.residuals.reporting.phrases import (
    capitalised,
    covariate_phrase,
    effect_phrase,
    listed,
    mechanism_phrase,
)

CUT_AGAIN = (
    "The streams were corrected and the windows cut again. The figures after correction are of the deployed model, "
    "unchanged, on the held-out pushes of the corrected recordings."
)
NO_STREAMS = "A push table contains no streams, so the error is reported but not corrected. Give the recording."
NOT_TRIED = (
    "Not tested, because some pushes lie outside the inputs of training: constant effects, unknown mechanisms, and "
    "effects that vary along a push."
)
NOT_JUDGED = "The measurement could not be checked for errors: these windows contain no contact gap or no pose."


def notes_of(question: Question, found: Searched) -> tuple[str, ...]:
    """Notes on the data, and on what was found or not tried in addition to the verdict."""
    if found.corrected is not None:
        corrected = [CUT_AGAIN] if found.corrected.evidence is not None else []
        return (*corrected, *([NO_STREAMS] if question.loaded.recordings is None else []), *_of_data(question))
    not_tried = [NOT_TRIED] if any(shift.extrapolates for shift in question.shifted) else []
    return (*_of_data(question), *_of_motion(found.motion), *_of_other_channels(found), *not_tried)


def _of_data(question: Question) -> tuple[str, ...]:
    """Which pushes and covariates were dropped."""
    dropped = question.loaded.dropped
    covariates = (f"{capitalised(covariate_phrase(name))} was dropped: {why}." for name, why in dropped.items())
    known = f"The model was trained on {question.trained} of the pushes: they are not judged."
    return (*[known] * bool(question.trained), *covariates)


def _of_motion(motion: MotionFinding) -> list[str]:
    notes = []
    if own := [effect_phrase(term.mechanism, term.best.covariate) for term in motion.terms if term.own]:
        notes.append(f"Retraining on such pushes is enough for {listed(own)}: no extension is needed.")
    if left := [effect_phrase(t.mechanism, t.best.covariate) for t in motion.terms if t.part]:
        notes.append(f"Fitted together with a listed effect, and not listed separately: {listed(left)}.")
    if motion.confounded:
        names = listed([covariate_phrase(name) for name in motion.confounded])
        notes.append(
            f"Not tested: {names}. Contact point, push angle and speed predict them in these pushes. "
            f"To test them, randomise the order of the pushes."
        )
    if motion.unchanged:
        effects = listed([effect_phrase(*label) for label in motion.unchanged])
        notes.append(f"Not new, because the training pushes show it to the same degree: {effects}.")
    return notes


def _of_other_channels(found: Searched) -> list[str]:
    motion, measured, forces = found.motion, found.measured, found.forces
    notes = []
    if measured is not None and measured.effects:
        errors = listed([mechanism_phrase(error.mechanism) for error in measured.effects])
        notes.append(
            f"The gap between pusher and slider suggests {errors}. Correcting for it does not improve the predictions."
        )
    if measured is None:
        notes.append(NOT_JUDGED)
    notes += [f"{_bias(fault.parameters)} The windows and predictions do not depend on it." for fault in found.harmless]
    notes += [f"{_bias(fault.parameters)} Zero the sensor, and record again." for fault in found.zero.effects]
    if found.noise.effects and forces.effects and not motion.terms:
        covariates = listed([covariate_phrase(effect.covariate) for effect in found.noise.effects])
        notes.append(f"The noise of the motion changed as well; it depends on {covariates}.")
    if motion.terms and forces.effects:
        effects = listed([effect_phrase(e.mechanism, e.covariate) for e in forces.effects])
        notes.append(f"The force changed as well: {effects}.")
    return notes


def _bias(parameters: Sequence[Sized]) -> str:
    sizes = " and ".join(f"{size.value:+.2g} N along {axis}" for size, axis in zip(parameters, "xy", strict=True))
    return f"The force sensor has a bias of {sizes}.".replace("-", "−")
