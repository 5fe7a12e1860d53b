# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The search of all channels: errors of measurement, the motion, its noise, the force, the zero of its sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.evaluation.offline import window_options
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.channels.contrast import GROSS, NOTHING_FOUND, ChannelEffect, ChannelFinding
from push_predictor.residuals.channels.measurement import correct, measurement_errors
from push_predictor.residuals.channels.motion import NO_MOTION, MotionFinding, motion_effects
from push_predictor.residuals.channels.sensor_zero import zero_shift
from push_predictor.residuals.channels.variance import variance_effects
from push_predictor.residuals.channels.wrench import wrench_effects
from push_predictor.residuals.evidence.loading import cut_again
from push_predictor.residuals.evidence.standardised import FEWEST_PUSHES, Evidence, evidence_of, held_out_rows
from push_predictor.residuals.question import ALPHA_SHARES, Question, unseen
from push_predictor.watch import Watch, no_watch

# Share of the windows, or of the mean squared residual, from which an error of the force sensor does harm. The mean
# square of a thousand residuals has a standard error of 4 %, so that no smaller change can matter to a verdict.
HARMLESS = 0.02
BADLY_OFF = 0.5  # mean excess of the squared residuals from which a correction must reduce them


@dataclass(frozen=True, eq=False)
class Searched:
    """What was found on each channel, before anything is opened that was held out; p values are family-wise.

    measured: None if the windows do not determine measurement errors. zero: a bias of the force sensor. corrected:
    None, or the measurement error that is the verdict. harmless: errors that change neither windows nor residuals.
    """

    measured: ChannelFinding | None
    motion: MotionFinding = NO_MOTION
    noise: ChannelFinding = NOTHING_FOUND
    forces: ChannelFinding = NOTHING_FOUND
    zero: ChannelFinding = NOTHING_FOUND
    corrected: Corrected | None = None
    harmless: tuple[ChannelEffect, ...] = ()


def search_all(question: Question, watch: Watch = no_watch) -> Searched:
    """What is found on each channel, before a model is extended or a held-out push is opened; watch: see `trace`."""
    training, seed, evidence = question.model.training, question.seed, question.evidence
    watch("measurement", 0.1)
    level = question.alpha_of("measurement")
    measured = measurement_errors(question.windows, training, question.loaded.rig, level, seed)
    measured = None if measured is None else measured.family_wise(ALPHA_SHARES["measurement"])
    if measured is not None and measured.effects:
        corrected = _corrected(question, measured.effects)
        if _explains_residuals(question, corrected):
            return Searched(measured, corrected=corrected)
    watch("motion", 0.15)
    motion = motion_effects(
        question.model, evidence, question.alpha_of("motion"), question.covariates, seed, inside=question.inside
    ).family_wise(ALPHA_SHARES["motion"])
    noise = _noise(question, motion)
    watch("force", 0.6)
    known = question.windows.take(question.inside)  # faster pushes need more force; training does not show how much
    forces = wrench_effects(known, training, evidence.mechanics, question.alpha_of("force"), seed)
    zero = zero_shift(known, training, question.alpha_of("zero")).family_wise(ALPHA_SHARES["zero"])
    found = Searched(measured, motion, noise, forces.family_wise(ALPHA_SHARES["force"]), zero)
    if not zero.effects:
        return found
    corrected = _corrected(question, zero.effects)
    if not _changes(question, corrected):
        return replace(found, zero=replace(zero, effects=()), harmless=zero.effects)
    alone = not (motion.terms or noise.effects or forces.effects)
    return replace(found, corrected=corrected if alone else None)


def _noise(question: Question, motion: MotionFinding) -> ChannelFinding:
    """Effects on the noise of what the motion's leave, in the windows among the inputs of training."""
    inside = question.inside
    evidence, z = question.evidence.take(inside), motion.unexplained[inside]
    if len(evidence.table.pushes) < FEWEST_PUSHES:
        return NOTHING_FOUND
    alpha, names, training = question.alpha_of("noise"), question.covariates, motion.training
    found = variance_effects(question.model, evidence, z, alpha, question.seed, names=names, training=training)
    return found.family_wise(ALPHA_SHARES["noise"])


@dataclass(frozen=True, eq=False)
class Corrected:
    """Measurement errors, and the same pushes cut again from corrected streams; None without streams."""

    errors: tuple[ChannelEffect, ...]
    evidence: Evidence | None
    held_out: PushTable | None


def _corrected(question: Question, errors: tuple[ChannelEffect, ...]) -> Corrected:
    """The windows of the recordings after all corrections."""
    if question.loaded.recordings is None:
        return Corrected(errors, None, None)
    recordings = list(question.loaded.recordings)
    for error in errors:
        recordings = [correct(recording, str(error.mechanism), error.values) for recording in recordings]
    again = cut_again(recordings, question.loaded.rig, window_options(question.model))
    table = unseen(question.deployed, again)
    held = held_out_rows(table)
    return Corrected(errors, evidence_of(question.model, table.take(~held)), table.take(held))


def _explains_residuals(question: Question, corrected: Corrected) -> bool:
    """Whether a correction halves the residuals of a model that is badly off.

    A compliant tip opens the gap like a late clock, but no correction of the clock brings the predictions back. Without
    streams to correct, or with small residuals, the gap alone decides.
    """
    if corrected.evidence is None:
        return True
    before, after = _excess(question.evidence), _excess(corrected.evidence)
    return before < BADLY_OFF or after < 0.5 * before


def _excess(evidence: Evidence) -> float:
    """Mean excess of the squared standardised residuals over 1; a square counts at most that of a gross error."""
    return float(np.mean(np.minimum(evidence.z**2, GROSS**2))) - 1.0


def _changes(question: Question, corrected: Corrected) -> bool:
    """Whether a correction changes more than HARMLESS of the windows, or the mean squared residual by more than that.

    Without streams nothing can be corrected, so that no change is shown.
    """
    if corrected.evidence is None or corrected.held_out is None:
        return False
    before, after = (
        _rows([question.windows, question.held_out]),
        _rows([corrected.evidence.table, corrected.held_out]),
    )
    known = len(before & after)
    if known < (1.0 - HARMLESS) * max(len(before), len(after)):
        return True
    squares = [float(np.mean(z**2)) for z in (evidence_of(question.model, question.windows).z, corrected.evidence.z)]
    return abs(squares[1] - squares[0]) > HARMLESS * squares[0]


def _rows(tables: Sequence[PushTable]) -> set[bytes]:
    """Windows by their inputs and durations: outcomes of held-out pushes stay closed."""
    return {row.tobytes() for t in tables for row in np.column_stack([t.inputs, t.duration])}
