# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Trace the residual of a deployed model to an effect that the model lacks, add it, and score the model again.

Channels are judged in order of trust. A measurement error is corrected before anything is concluded about the motion,
and effects on the mean, of the motion and then of the force, before effects on the variance. The held-out pushes are
opened once, at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

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
from push_predictor.residuals.channels.clocks import NAMES, clock_errors, clock_notes
from push_predictor.residuals.channels.contrast import ChannelEffect, ChannelFinding
from push_predictor.residuals.channels.motion import MotionFinding
from push_predictor.residuals.channels.sensor_zero import WRENCH_BIAS
from push_predictor.residuals.evidence.drivers import SESSION
from push_predictor.residuals.evidence.input_shift import ShiftedInput
from push_predictor.residuals.evidence.loading import LoadedData, load_evidence
from push_predictor.residuals.evidence.split import digest_of
from push_predictor.residuals.evidence.standardised import evidence_of
from push_predictor.residuals.extension.extended_model import along, by_the_clock, extend, refit_base
from push_predictor.residuals.extension.held_out_gain import HeldOutGain, compared, held_out_gain, held_out_windows
from push_predictor.residuals.outcome import FoundEffect, Harmless, HeldOut, Sized, Tested, Trace, Verdict, size_of
from push_predictor.residuals.question import SHARES, Question
from push_predictor.residuals.reporting.notes import CUT_AGAIN, NO_STREAMS, notes_of, notes_of_data, notes_of_shift
from push_predictor.watch import Watch, no_watch

if TYPE_CHECKING:
    from push_predictor.recordings.checks.data_checks import DataChecks

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
    model = model if isinstance(model, PushModel) else load_model(Path(model))
    data = [Path(path) for path in paths]
    options, inspect = window_options(model), checks or no_inspection
    loaded = load_evidence(data, rig, options, topics=topics, inspect=inspect)
    clocks: tuple[Finding, ...] = ()
    if checks is not None:
        checks.judged_by(data, loaded.table, loaded.rig)
        clocks = checks.found(*NAMES)
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
    if found.corrected is not None:
        return _of_measurement(question, found.corrected, (CUT_AGAIN if found.corrected.evidence else NO_STREAMS,))
    if clocks and (found.motion.terms or found.motion.variance or found.forces.effects):
        return _of_measurement(question, Corrected(clock_errors(clocks), None, None), clock_notes(clocks))
    watch("extended model", 0.7)
    return _of_motion(question, found, clock_notes(clocks))


@dataclass(frozen=True, eq=False)
class _Extension:
    """The refit, the model with the effects (None if none were added), all effects found, and the gain."""

    refit: PushModel
    after: PushModel | None
    effects: tuple[Effect, ...]
    gain: HeldOutGain | None


# --- measurement ---------------------------------------------------------------------------------------------------


def _of_measurement(question: Question, corrected: Corrected, notes: Sequence[str]) -> Trace:
    """The trace of a measurement error: the deployed model, unchanged, on corrected windows where there are streams."""
    model, measured = question.model, corrected.finding
    first = measured.effects[0]
    refit = held_out_windows(refit_base(model, question.evidence.table)).calibrated()
    return Trace(
        verdict="measurement",
        kind="mean",
        model=question.deployed,
        effects=_of_channel(measured.effects, "measurement"),
        terms=(),
        equivalent=(),
        mechanisms=first.rivals,
        undecided=bool(first.rivals),
        analysis=question.windows,
        residual=question.evidence.z,
        find_unexplained=lambda: (corrected.evidence or question.evidence).z,
        held_out=_held_out(question, refit, model, corrected.held_out or question.held_out),
        gain_nmse=NO_GAIN,
        gain_nlpd=NO_GAIN,
        gain_over="refit",
        extended=None,
        tested=_family_wise(measured.tested, "measurement"),
        minimum_detectable={},
        remaining=None,
        alpha=question.alpha,
        input_shift=question.shifted,
        notes=(*notes, *notes_of_data(question)),
    )


# --- motion, variance and wrench -----------------------------------------------------------------------------------


def _of_motion(question: Question, found: Searched, notes: Sequence[str]) -> Trace:
    motion, measured, forces = found.motion, found.measured, found.forces
    extension = _extension(question, motion)
    gain, after = extension.gain, extension.after or extension.refit
    verdict = _verdict(motion, forces, question.shifted)
    equivalent = _rival_covariates(forces) if verdict == "wrench_only" else motion.equivalent
    tested = _family_wise(motion.tested, "motion"), _family_wise(forces.tested, "wrench")
    return Trace(
        verdict=verdict,
        kind="mean" if motion.terms else "variance" if verdict == "variance" else None,
        model=question.deployed,
        effects=_found_effects(question, motion, forces, extension.effects),
        terms=extension.effects,
        equivalent=equivalent,
        mechanisms=motion.mechanisms,
        undecided=bool(equivalent),
        analysis=question.windows,
        residual=question.evidence.z,
        find_unexplained=lambda: evidence_of(after, question.evidence.table).z,
        held_out=_held_out(question, extension.refit, after, question.held_out),
        gain_nmse=gain.nmse if gain else NO_GAIN,
        gain_nlpd=gain.nlpd if gain else NO_GAIN,
        gain_over=gain.reference if gain else "refit",
        extended=extension.after if gain and gain.nlpd.high < 0.0 else None,
        tested=(tested[0] + _family_wise(measured.tested if measured else (), "measurement") + tested[1]),
        minimum_detectable=motion.minimum_detectable,
        remaining=motion.remaining,
        alpha=question.alpha,
        input_shift=question.shifted,
        harmless=tuple(
            Harmless(fault.mechanism, size.with_errors_of_mechanics())
            for fault in found.harmless
            for size in fault.parameters
        ),
        notes=(*notes, *notes_of(question, found), *notes_of_shift(question.shifted)),
    )


def _extension(question: Question, motion: MotionFinding) -> _Extension:
    """The refit, extended by the effects that it cannot learn in its own inputs."""
    model, evidence = question.model, question.evidence
    refit = refit_base(model, evidence.table)
    candidates = [by_the_clock(term.term, evidence.table) for term in motion.terms if not term.own]
    session = question.deployed.predictor.session.followed_by(question.loaded.session)
    after = extend(refit, evidence, candidates, session) if candidates else None
    added = iter(after.predictor.effects[-len(candidates) :] if after else ())
    # An effect in the model's own inputs is reported at its full size, but the refit learns it.
    effects = tuple(
        estimated(fitted(FitRows(evidence), [t.best]), of_size=True)[0][0] if t.own else along(t.best, next(added))
        for t in motion.terms
    )
    gain = held_out_gain(model, refit, after, evidence.table, question.held_out) if after else None
    return _Extension(held_out_windows(refit).calibrated(), after, effects, gain)


def _verdict(motion: MotionFinding, forces: ChannelFinding, shifted: Sequence[ShiftedInput]) -> Verdict:
    """The verdict: a mean effect, of the motion or else of the force, before one on the variance.

    A force that differs also bends tip and rod differently, which can look like noise that changed a little.
    """
    if motion.terms:
        if motion.terms[0].mechanism is None:
            return "driver_only"
        return "mechanism_only" if motion.equivalent else "effect"
    if forces.effects:
        return "wrench_only"
    if motion.variance:
        return "variance"
    return "input_shift" if shifted else "none"


def _rival_covariates(forces: ChannelFinding) -> tuple[str, ...]:
    """Rivals of the covariate that the force depends on first."""
    first = next(iter(forces.effects), None)
    return () if first is None else tuple(name for name in first.rivals if name != WRENCH_BIAS)


def _found_effects(
    question: Question, motion: MotionFinding, forces: ChannelFinding, effects: Sequence[Effect]
) -> tuple[FoundEffect, ...]:
    """The effects on the channel that the verdict is about."""
    if motion.terms:
        return tuple(
            FoundEffect(
                term.mechanism,
                SESSION if term.since_training else term.best.covariate,
                term.outputs,
                term.best.basis.name,
                None if term.mechanism is None else size_of(effect, question.evidence.table),
                _of_trace(term.p_value, "motion"),
                term.share,
                term.resembles,
            )
            for term, effect in zip(motion.terms, effects, strict=True)
            if not term.part
        )
    if motion.variance and not forces.effects:
        return tuple(
            FoundEffect(None, s.covariate, s.outputs, s.basis.name, None, _of_trace(s.p_value, "motion"), 0.0)
            for s in motion.variance
        )
    return _of_channel(forces.effects, "wrench")


def _of_channel(effects: Sequence[ChannelEffect], channel: str) -> tuple[FoundEffect, ...]:
    """One effect of the JSON for each parameter."""
    return tuple(
        FoundEffect(e.mechanism, e.covariate, (), e.basis, parameter, _of_trace(e.p_value, channel), 0.0)
        for e in effects
        for parameter in map(Sized.with_errors_of_mechanics, e.parameters)
    )


# --- held-out pushes and levels ------------------------------------------------------------------------------------


def _held_out(question: Question, refit: PushModel, after: PushModel, held: PushTable) -> HeldOut:
    """Held-out pushes by all three models; the last on `held`, which differs if the measurement was corrected."""
    mean, table = question.deployed.training_mean, question.held_out
    return HeldOut(
        table,
        compared(question.deployed, table, mean),
        compared(refit, table, mean),
        compared(after, held, mean),
        digest_of(table),
    )


def _family_wise(tested: Sequence[Tested], channel: str) -> tuple[Tested, ...]:
    return tuple(replace(one, p_value=_of_trace(one.p_value, channel)) for one in tested)


def _of_trace(p_value: float, channel: str) -> float:
    """A channel's p value as one of the whole trace: at most alpha exactly if it is at most the channel's share."""
    return min(1.0, p_value / SHARES[channel])
