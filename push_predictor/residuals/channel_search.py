# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The search of all channels: errors of measurement, then the motion, then the force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.evaluation.offline import window_options
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.channels.contrast import GROSS, NOTHING_FOUND, ChannelEffect, ChannelFinding
from push_predictor.residuals.channels.measurement import correct, measurement_errors
from push_predictor.residuals.channels.motion import NO_MOTION, MotionFinding, motion_effects
from push_predictor.residuals.channels.sensor_zero import WRENCH_BIAS
from push_predictor.residuals.channels.wrench import wrench_effects
from push_predictor.residuals.evidence.loading import cut_again
from push_predictor.residuals.evidence.split import held_out_rows
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of
from push_predictor.residuals.question import Question, unseen
from push_predictor.watch import Watch, no_watch

# Share of the windows, or of the mean squared residual, from which an error of the force sensor does harm. The mean
# square of a thousand residuals has a standard error of 4 %, so that no smaller change can matter to a verdict.
HARMLESS = 0.02
BADLY_OFF = 0.5  # mean excess of the squared residuals from which a correction must reduce them


def search_all(question: Question, watch: Watch = no_watch) -> Searched:
    """What is found on each channel, before a model is extended or a held-out push is opened; watch: see `trace`."""
    model, analysis, seed = question.model, question.windows, question.seed
    watch("measurement", 0.1)
    measured = measurement_errors(analysis, model.training, question.loaded.rig, question.share("measurement"), seed)
    if measured is not None and measured.effects:
        corrected = _corrected(question, measured)
        if _explains_residuals(question, corrected):
            return Searched(measured, NO_MOTION, NOTHING_FOUND, corrected)
    watch("motion", 0.15)
    motion = motion_effects(
        model, question.evidence, question.share("motion"), question.covariates, seed, inside=question.inside
    )
    watch("force", 0.6)
    known = analysis.take(question.inside)  # faster pushes need more force, and training does not show how much
    forces = wrench_effects(known, model.training, question.evidence.mechanics, question.share("wrench"), seed)
    bias = _bias_of(forces)
    if bias is None:
        return Searched(measured, motion, forces)
    corrected = _corrected(question, ChannelFinding((bias,), forces.tested))
    if not _changes(question, corrected):
        return Searched(measured, motion, _without_bias(forces), harmless=(bias,))
    first = forces.effects[0].mechanism == WRENCH_BIAS if forces.effects else not motion.variance
    return Searched(measured, motion, forces, corrected if first and not motion.terms else None)


@dataclass(frozen=True, eq=False)
class Searched:
    """What was found on each channel, before anything is opened that was held out.

    measured: None if the windows do not determine measurement errors. corrected: None, or the measurement error that is
    the verdict. harmless: errors that change neither windows nor residuals.
    """

    measured: ChannelFinding | None
    motion: MotionFinding
    forces: ChannelFinding
    corrected: Corrected | None = None
    harmless: tuple[ChannelEffect, ...] = ()


@dataclass(frozen=True, eq=False)
class Corrected:
    """Measurement errors, and the same pushes cut again from corrected streams; None without streams."""

    finding: ChannelFinding
    evidence: Evidence | None
    held_out: PushTable | None


def _corrected(question: Question, measured: ChannelFinding) -> Corrected:
    """The windows of the recordings after all corrections."""
    if question.loaded.recordings is None:
        return Corrected(measured, None, None)
    recordings = list(question.loaded.recordings)
    for error in measured.effects:
        recordings = [correct(recording, error.mechanism, error.values) for recording in recordings]
    again = cut_again(recordings, question.loaded.rig, window_options(question.model))
    table = unseen(question.deployed, again)
    held = held_out_rows(table)
    return Corrected(measured, evidence_of(question.model, table.take(~held)), table.take(held))


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


def _bias_of(forces: ChannelFinding) -> ChannelEffect | None:
    """A bias of the force sensor: a measurement error, though it is found on the wrench channel."""
    found = (each for each in (*forces.effects, forces.zero) if each is not None and each.mechanism == WRENCH_BIAS)
    return next(found, None)


def _without_bias(forces: ChannelFinding) -> ChannelFinding:
    return replace(forces, effects=tuple(e for e in forces.effects if e.mechanism != WRENCH_BIAS), zero=None)


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
