# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Trace the residual of a deployed model to an effect that the model lacks, add it, and score the model again.

Channels are judged in order of trust. A measurement error is corrected before anything is concluded about the motion,
and effects on the mean, of the motion and then of the force, before effects on the variance. The held-out pushes are
opened once, at the end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.offline import window_options
from push_predictor.models.effects.effect import Effect
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.load import no_inspection
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.topics import Topics
from push_predictor.residuals.candidates.joint_fit import FitRows, estimated, fitted
from push_predictor.residuals.channel_search import Corrected, Searched, search_all
from push_predictor.residuals.channels.contrast import ChannelEffect
from push_predictor.residuals.channels.measurement import CLOCKS, clock_errors, clock_notes
from push_predictor.residuals.channels.motion import MotionFinding
from push_predictor.residuals.evidence.drivers import SESSION
from push_predictor.residuals.evidence.input_shift import ShiftedInput
from push_predictor.residuals.evidence.loading import LoadedData, load_evidence
from push_predictor.residuals.evidence.standardised import digest_of, evidence_of
from push_predictor.residuals.extension.extended_model import along, by_the_clock, extend, refit_base
from push_predictor.residuals.extension.held_out_gain import HeldOutGain, compared, held_out_gain, held_out_windows
from push_predictor.residuals.outcome import FoundEffect, HeldOut, Sized, Tested, Trace, Verdict, size_of
from push_predictor.residuals.question import Question
from push_predictor.residuals.reporting.notes import notes_of
from push_predictor.types import Array
from push_predictor.watch import Watch, no_watch

if TYPE_CHECKING:
    from push_predictor.recordings.checks.check import DataChecks

NO_GAIN = Estimate(0.0, 0.0, 0.0)


def trace_data(
    paths: Sequence[Path | str],
    model: PushModel | Path | str,
    *,
    alpha: float = 0.01,
    covariates: Sequence[str] | None = None,
    rig: Rig | None = None,
    seed: int = 0,
    watch: Watch = no_watch,
    topics: Topics = Topics(),
    checks: DataChecks | None = None,
) -> Trace:
    """Judge a model, or a model file, on recordings or push tables that it was not trained on; see `trace`.

    topics: of all recordings. checks: of the data and of what their pushes cover.
    """
    watch("windows", 0.0)
    model = model if isinstance(model, PushModel) else load_model(model)
    data = [Path(path) for path in paths]
    options, inspect = window_options(model), checks or no_inspection
    loaded = load_evidence(data, rig, options, topics=topics, inspect=inspect)
    clocks: tuple[Finding, ...] = ()
    if checks is not None:
        checks.judged_by(data, loaded.table, loaded.rig)
        clocks = checks.found(*CLOCKS)
    return trace(model, loaded, alpha=alpha, covariates=covariates, seed=seed, watch=watch, clocks=clocks)


def trace(
    model: PushModel,
    loaded: LoadedData,
    *,
    alpha: float = 0.01,
    covariates: Sequence[str] | None = None,
    seed: int = 0,
    watch: Watch = no_watch,
    clocks: Sequence[Finding] = (),
) -> Trace:
    """Find what the model fails to explain in these windows, and what it depends on.

    alpha: probability of any false alarm if nothing changed. covariates: those to try, all recorded ones if None.
    watch: called with the name of each stage and the share of the work done when it begins. clocks: findings of `check`
    about clocks that are off; no model is extended then. Raises RequestError for an alpha outside (0, 1), a covariate
    that is not recorded, or too few pushes.
    """
    question = Question.of(model, loaded, alpha, covariates, seed)
    found = search_all(question, watch)
    if clocks and found.corrected is None and (found.motion.terms or found.noise.effects or found.forces.effects):
        found = Searched(found.measured, corrected=Corrected(clock_errors(clocks), None, None))
    watch("extended model", 0.7)
    motion, corrected = found.motion, found.corrected
    extension = _extension(question, motion)
    gain, refit = extension.gain, held_out_windows(extension.refit).calibrated()
    after = question.model if corrected else extension.after or refit
    verdict = _verdict(found, question.shifted)
    equivalent, mechanisms = _rivals(verdict, found)
    return Trace(
        verdict=verdict,
        kind="variance" if verdict == "variance" else "mean" if corrected or motion.terms else None,
        model=question.deployed,
        effects=_found_effects(verdict, question, found, extension.effects),
        terms=extension.effects,
        equivalent=equivalent,
        mechanisms=mechanisms,
        undecided=bool(equivalent or (corrected and mechanisms)),
        analysis=question.windows,
        residual=question.evidence.z,
        find_unexplained=lambda: _unexplained(question, corrected, after),
        held_out=_held_out(question, refit, after, corrected.held_out if corrected else None),
        gain_nmse=gain.nmse if gain else NO_GAIN,
        gain_nlpd=gain.nlpd if gain else NO_GAIN,
        gain_over=gain.reference if gain else "refit",
        extended=extension.after if gain and gain.nlpd.high < 0.0 else None,
        tested=_tested(found),
        minimum_detectable=_minimum_detectable(found),
        remaining=motion.remaining,
        alpha=question.alpha,
        input_shift=question.shifted,
        harmless=_of_channel(found.harmless),
        notes=(*clock_notes(clocks), *notes_of(question, found)),
    )


@dataclass(frozen=True, eq=False)
class _Extension:
    """The refit, the model with the effects (None if none were added), all effects found, and the gain."""

    refit: PushModel
    after: PushModel | None
    effects: tuple[Effect, ...]
    gain: HeldOutGain | None


def _extension(question: Question, motion: MotionFinding) -> _Extension:
    """The refit, extended by the effects that it cannot learn in its own inputs."""
    model, evidence = question.model, question.evidence
    refit = refit_base(model, evidence.table)
    candidates = [by_the_clock(term, evidence.table) for term in motion.terms if not term.own]
    session = question.deployed.predictor.session.followed_by(question.loaded.session)
    after = extend(refit, evidence, candidates, session) if candidates else None
    added = iter(after.predictor.effects[-len(candidates) :] if after else ())
    # An effect in the model's own inputs is reported at its full size, but the refit learns it.
    effects = tuple(
        estimated(fitted(FitRows(evidence), [t.best]), of_size=True)[0][0] if t.own else along(t.best, next(added))
        for t in motion.terms
    )
    gain = held_out_gain(model, refit, after, evidence.table, question.held_out) if after else None
    return _Extension(refit, after, effects, gain)


def _verdict(found: Searched, shifted: Sequence[ShiftedInput]) -> Verdict:
    """The verdict: a mean effect, of the motion or else of the force, before one on the variance.

    A force that differs also bends tip and rod differently, which can look like noise that changed a little.
    """
    if found.corrected is not None:
        return "measurement"
    if found.motion.terms:
        if found.motion.terms[0].mechanism is None:
            return "driver_only"
        return "mechanism_only" if found.motion.equivalent else "effect"
    if found.forces.effects:
        return "wrench_only"
    if found.noise.effects:
        return "variance"
    return "input_shift" if shifted else "none"


def _channel_effects(verdict: Verdict, found: Searched) -> tuple[ChannelEffect, ...]:
    """The effects on the channel that the verdict is about, if that is not the mean motion."""
    errors = found.corrected.errors if found.corrected else ()
    of_channel = {"measurement": errors, "wrench_only": found.forces.effects, "variance": found.noise.effects}
    return of_channel.get(verdict, ())


def _rivals(verdict: Verdict, found: Searched) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Rivals of the first effect's covariate, and of its mechanism."""
    of_channel = _channel_effects(verdict, found)
    if not of_channel:
        return found.motion.equivalent, found.motion.mechanisms
    return ((), of_channel[0].rivals) if verdict == "measurement" else (of_channel[0].rivals, ())


def _found_effects(
    verdict: Verdict, question: Question, found: Searched, effects: Sequence[Effect]
) -> tuple[FoundEffect, ...]:
    """The effects of the JSON: of the mean motion, or one for each parameter of a channel's effects."""
    of_motion = (
        FoundEffect(
            term.mechanism,
            SESSION if term.since_training else term.best.covariate,
            term.outputs,
            term.best.basis.name,
            None if term.mechanism is None else size_of(effect, question.evidence.table),
            term.p_value,
            term.share,
            term.naming.resembles,
        )
        for term, effect in zip(found.motion.terms, effects, strict=True)
        if not term.part
    )
    return (*of_motion, *_of_channel(_channel_effects(verdict, found)))


def _of_channel(effects: Sequence[ChannelEffect]) -> tuple[FoundEffect, ...]:
    """One effect of the JSON for each parameter."""
    return tuple(
        FoundEffect(e.mechanism, e.covariate, e.outputs, e.basis, parameter, e.p_value, 0.0)
        for e in effects
        for parameter in map(Sized.with_errors_of_mechanics, e.parameters)
    )


def _unexplained(question: Question, corrected: Corrected | None, after: PushModel) -> Array:
    """Standardised residuals (n, 3) after the trace."""
    if corrected:
        return (corrected.evidence or question.evidence).z
    return evidence_of(after, question.evidence.table).z


def _held_out(question: Question, refit: PushModel, after: PushModel, again: PushTable | None) -> HeldOut:
    """Held-out pushes by all three models; the last on those cut again, if the measurement was corrected."""
    mean, table = question.deployed.training_mean, question.held_out
    return HeldOut(
        table,
        compared(question.deployed, table, mean),
        compared(refit, table, mean),
        compared(after, table if again is None else again, mean),
        digest_of(table),
    )


def _tested(found: Searched) -> tuple[Tested, ...]:
    measured = found.measured.tested if found.measured else ()
    return (*found.motion.tested, *measured, *found.forces.tested, *found.zero.tested)


def _minimum_detectable(found: Searched) -> dict[str, Mapping[str, Any]]:
    """By mechanism the smallest effect that would have been found, and the smallest factor on the noise."""
    if not np.isfinite(found.noise.detectable):
        return {**found.motion.minimum_detectable}
    noise = {"value": found.noise.detectable, "unit": "times training", "covariate": SESSION}
    return {**found.motion.minimum_detectable, "noise": noise}
