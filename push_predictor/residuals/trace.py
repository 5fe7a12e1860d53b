"""Trace the residual of a deployed model to an effect that the model lacks, add it, and score the model again.

Channels are judged in order of trust. A measurement error is corrected before anything is concluded about the motion,
and effects on the mean, of the motion and then of the force, before effects on the variance. The held-out pushes are
opened once, at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.evaluation.offline import window_options
from push_predictor.models.effects.effect import Effect
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.models.watch import Watch, no_watch
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.coefficients import estimated_effects
from push_predictor.residuals.channels.corrections import correct
from push_predictor.residuals.channels.measurement import MeasurementFault, MeasurementFinding, measurement_errors
from push_predictor.residuals.channels.motion import NO_MOTION, MotionFinding, motion_effects
from push_predictor.residuals.channels.wrench import NO_WRENCH, WRENCH_BIAS, WrenchFinding, wrench_effects
from push_predictor.residuals.evidence.drivers import SESSION
from push_predictor.residuals.evidence.extrapolation import about_mechanics, widened
from push_predictor.residuals.evidence.input_shift import ShiftedInput, input_shift
from push_predictor.residuals.evidence.instrument import GAP, with_instrument
from push_predictor.residuals.evidence.loading import (
    LoadedData,
    corrected_data,
    load_evidence,
    previous_residual,
)
from push_predictor.residuals.evidence.split import digest_of, held_out_rows
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of
from push_predictor.residuals.extension.effect_size import size_of
from push_predictor.residuals.extension.extended_model import extend
from push_predictor.residuals.extension.held_out_gain import HeldOutGain, compared, held_out_gain
from push_predictor.residuals.extension.recalibration import held_out_windows
from push_predictor.residuals.extension.refit import refit_base
from push_predictor.residuals.outcome import FoundEffect, Gain, HeldOut, Tested, Trace, Verdict
from push_predictor.residuals.reporting.notes import CUT_AGAIN, NO_STREAMS, notes_of, notes_of_data
from push_predictor.residuals.selection.absolute_fit import left_by
from push_predictor.types import BoolArray

FEWEST_PUSHES = 12
SHARES = {"motion": 0.6, "measurement": 0.2, "wrench": 0.2}  # of alpha: every kind of false alarm counts
BADLY_OFF = 0.5  # mean excess of the squared residuals from which a correction must reduce them
NO_GAIN = Gain(0.0, 0.0, 0.0)


def trace_data(
    paths: Sequence[Path | str],
    model_path: Path | str,
    *,
    alpha: float = 0.01,
    covariates: Sequence[str] | None = None,
    rig: Rig | None = None,
    seed: int = 0,
    watch: Watch = no_watch,
    experiment: Sequence[Path | str] = (),
) -> Trace:
    """Judge a model file on recordings or push tables that it was not trained on; see `trace`.

    experiment: recordings of the pushes that an earlier trace proposed. They are analysed and never held out, so that
    the errors before and after are of the same pushes as in that trace.
    """
    watch("windows", 0.0)
    model = load_model(Path(model_path))
    data, designed = ([Path(path) for path in given] for given in (paths, experiment))
    loaded = load_evidence(data, rig, window_options(model), experiment=designed)
    return trace(model, loaded, alpha=alpha, covariates=covariates, seed=seed, watch=watch)


def trace(
    model: PushModel,
    loaded: LoadedData,
    *,
    alpha: float = 0.01,
    covariates: Sequence[str] | None = None,
    seed: int = 0,
    watch: Watch = no_watch,
) -> Trace:
    """Find what the model fails to explain in these windows, and what it depends on.

    alpha: probability of any false alarm if nothing changed. covariates: those to try, all recorded ones if None.
    watch: called with the name of each stage and the share of the work done when it begins. Raises RequestError for an
    alpha outside (0, 1), a covariate that is not recorded, or too few pushes.
    """
    context = _Context.of(model, loaded, alpha, covariates, seed)
    found = _searched(context, watch)
    if found.corrected is not None:
        return _of_measurement(context, found.corrected)
    watch("extended model", 0.7)
    return _of_motion(context, found)


@dataclass(frozen=True, eq=False)
class Searched:
    """What was found on each channel, before anything is opened that was held out.

    measured: None if the windows do not determine measurement errors. corrected: None, or the measurement error that
    explains the residuals; nothing else was searched for then.
    """

    measured: MeasurementFinding | None
    motion: MotionFinding
    forces: WrenchFinding
    corrected: _Corrected | None = None


def search_channels(
    model: PushModel,
    loaded: LoadedData,
    *,
    alpha: float = 0.01,
    covariates: Sequence[str] | None = None,
    seed: int = 0,
) -> Searched:
    """Search the windows like `trace`, but extend no model and open no held-out pushes."""
    return _searched(_Context.of(model, loaded, alpha, covariates, seed), no_watch)


@dataclass(frozen=True, eq=False)
class _Context:
    """The question of a trace and its data, split once: the analysis pushes, their evidence, and the held-out pushes.

    model: the deployed one, or one about mechanics where that cannot extrapolate. windows: of the analysis, as they
    were measured. inside: those among the inputs of training.
    """

    deployed: PushModel
    model: PushModel
    loaded: LoadedData
    alpha: float
    covariates: tuple[str, ...] | None
    seed: int
    windows: PushTable
    evidence: Evidence
    inside: BoolArray
    held_out: PushTable
    shifted: tuple[ShiftedInput, ...]

    @classmethod
    def of(
        cls, model: PushModel, loaded: LoadedData, alpha: float, covariates: Sequence[str] | None, seed: int
    ) -> _Context:
        """Predict all windows, add the previous push's residual to their covariates, and split them."""
        _check(model, loaded.table, alpha, covariates)
        shift = input_shift(model, loaded.table)
        searched = about_mechanics(model) if shift.inputs else model
        every = widened(evidence_of(searched, loaded.table), model.training, shift)
        every = replace(every, chosen=loaded.chosen)
        before = previous_residual(loaded.table, every.z)
        table = replace(loaded.table, covariates={**loaded.table.covariates, "previous_residual": before})
        held, usable = held_out_rows(table, loaded.chosen), with_instrument(table)
        if GAP in (covariates or ()) and GAP not in usable.covariates:
            raise RequestError(
                "covariate", GAP, "pushes of several windows: a window's own gap shares the outcome's noise"
            )
        return cls(
            deployed=model,
            model=searched,
            loaded=loaded,
            alpha=alpha,
            covariates=None if covariates is None else tuple(covariates),
            seed=seed,
            windows=table.take(~held),
            evidence=replace(every.take(~held), table=usable.take(~held)),
            inside=~shift.outside[~held],
            held_out=table.take(held),
            shifted=shift.inputs,
        )

    def share(self, channel: str) -> float:
        """The part of alpha that a channel may spend."""
        return SHARES[channel] * self.alpha


@dataclass(frozen=True, eq=False)
class _Corrected:
    """Measurement errors, and the same pushes cut again from corrected streams; None without streams."""

    finding: MeasurementFinding
    evidence: Evidence | None
    held_out: PushTable | None


@dataclass(frozen=True, eq=False)
class _Extension:
    """The refit, the model with the effects (None if none were added), all effects found, and the gain."""

    refit: PushModel
    after: PushModel | None
    effects: tuple[Effect, ...]
    gain: HeldOutGain | None


# --- search --------------------------------------------------------------------------------------------------------


def _searched(context: _Context, watch: Watch) -> Searched:
    model, analysis, seed = context.model, context.windows, context.seed
    watch("measurement", 0.1)
    measured = measurement_errors(analysis, model.training, context.loaded.rig, context.share("measurement"), seed)
    if measured is not None and measured.errors:
        corrected = _corrected(context, measured)
        if _explains_residuals(context, corrected):
            return Searched(measured, NO_MOTION, NO_WRENCH, corrected)
    watch("motion", 0.15)
    motion = motion_effects(
        model, context.evidence, context.share("motion"), context.covariates, seed, inside=context.inside
    )
    watch("force", 0.6)
    known = analysis.take(context.inside)  # faster pushes need more force, and training does not show how much
    forces = wrench_effects(known, model.training, context.evidence.physics, context.share("wrench"), seed)
    biased = None if motion.terms else _biased(forces, spread=bool(motion.variance))
    return Searched(measured, motion, forces, None if biased is None else _corrected(context, biased))


# --- measurement ---------------------------------------------------------------------------------------------------


def _corrected(context: _Context, measured: MeasurementFinding) -> _Corrected:
    """The windows of the recordings after all corrections."""
    if context.loaded.recordings is None:
        return _Corrected(measured, None, None)
    recordings = list(context.loaded.recordings)
    for error in measured.errors:
        recordings = [correct(recording, error.mechanism, error.values) for recording in recordings]
    again = corrected_data(context.loaded, recordings, window_options(context.model))
    held = held_out_rows(again.table, again.chosen)
    analysis, held_out = again.table.take(~held), again.table.take(held)
    return _Corrected(measured, replace(evidence_of(context.model, analysis), chosen=again.chosen), held_out)


def _explains_residuals(context: _Context, corrected: _Corrected) -> bool:
    """Whether a correction halves the residuals of a model that is badly off.

    A compliant tip opens the gap like a late clock, but no correction of the clock brings the predictions back. Without
    streams to correct, or with small residuals, the gap alone decides.
    """
    if corrected.evidence is None:
        return True
    before, after = _excess(context.evidence), _excess(corrected.evidence)
    return before < BADLY_OFF or after < 0.5 * before


def _excess(evidence: Evidence) -> float:
    """Mean excess of the squared standardised residuals over 1; each square counts at most 25."""
    return float(np.mean(np.minimum(evidence.z**2, 25.0))) - 1.0


def _biased(forces: WrenchFinding, spread: bool) -> MeasurementFinding | None:
    """A bias of the force sensor as a measurement error, though it is found on the wrench channel.

    One of the sensor's zero does no harm to the windows, so it is the answer only if neither the force in contact nor
    the spread of the outcomes changed.
    """
    first = next(iter(forces.effects), None if spread else forces.zero)
    if first is None or first.mechanism != WRENCH_BIAS:
        return None
    size = float(np.linalg.norm([parameter.value for parameter in first.parameters]))
    error = MeasurementFault(
        first.mechanism, first.parameters, first.p_value, first.rivals, size, first.covariate, first.basis
    )
    return MeasurementFinding((error,), forces.tested, forces.noise, forces.against_training)


def _of_measurement(context: _Context, corrected: _Corrected) -> Trace:
    """The trace of a measurement error: the deployed model, unchanged, on corrected windows where there are streams."""
    model, measured = context.model, corrected.finding
    first, cut = measured.errors[0], corrected.evidence is not None
    refit = held_out_windows(refit_base(model, context.evidence.table)).calibrated()
    return Trace(
        verdict="measurement",
        kind="mean",
        model=context.deployed,
        effects=tuple(
            FoundEffect(e.mechanism, e.covariate, (), e.basis, parameter, _of_trace(e.p_value, "measurement"), 0.0)
            for e in measured.errors
            for parameter in e.parameters
        ),
        terms=(),
        equivalent=(),
        mechanisms=first.rivals,
        undecided=bool(first.rivals),
        analysis=context.windows,
        residual=context.evidence.z,
        unexplained=(corrected.evidence or context.evidence).z,
        held_out=_held_out(context, refit, model, corrected.held_out or context.held_out),
        gain_nmse=NO_GAIN,
        gain_nlpd=NO_GAIN,
        gain_over="refit",
        extended=None,
        tested=_family_wise(measured.tested, "measurement"),
        minimum_detectable={},
        remaining=None,
        experiment=(),
        alpha=context.alpha,
        input_shift=context.shifted,
        notes=(CUT_AGAIN if cut else NO_STREAMS, *notes_of_data(context.loaded)),
    )


# --- motion, variance and wrench -----------------------------------------------------------------------------------


def _of_motion(context: _Context, found: Searched) -> Trace:
    motion, measured, forces = found.motion, found.measured, found.forces
    extension = _extension(context, motion)
    gain, after = extension.gain, extension.after or extension.refit
    verdict = _verdict(motion, forces, context.shifted)
    equivalent = _rival_covariates(forces) if verdict == "wrench_only" else motion.equivalent
    tested = _family_wise(motion.tested, "motion"), _family_wise(forces.tested, "wrench")
    return Trace(
        verdict=verdict,
        kind="mean" if motion.terms else "variance" if verdict == "variance" else None,
        model=context.deployed,
        effects=_found_effects(context, motion, forces, extension.effects),
        terms=extension.effects,
        equivalent=equivalent,
        mechanisms=motion.mechanisms,
        undecided=bool(equivalent),
        analysis=context.windows,
        residual=context.evidence.z,
        unexplained=evidence_of(after, context.evidence.table).z,
        held_out=_held_out(context, extension.refit, after, context.held_out),
        gain_nmse=gain.nmse if gain else NO_GAIN,
        gain_nlpd=gain.nlpd if gain else NO_GAIN,
        gain_over=gain.reference if gain else "refit",
        extended=extension.after if gain and gain.nlpd.high < 0.0 else None,
        tested=(tested[0] + _family_wise(measured.tested if measured else (), "measurement") + tested[1]),
        minimum_detectable=motion.minimum_detectable,
        remaining=motion.remaining,
        experiment=motion.experiment.pushes,
        alpha=context.alpha,
        input_shift=context.shifted,
        notes=notes_of(context.loaded, motion, measured, forces),
    )


def _extension(context: _Context, motion: MotionFinding) -> _Extension:
    """The refit, extended by the effects that it cannot learn in its own inputs."""
    model, evidence = context.model, context.evidence
    refit = refit_base(model, evidence.table)
    candidates = [term.best for term in motion.terms if not term.own]
    after = extend(refit, evidence, candidates) if candidates else None
    added = iter(after.predictor.effects[-len(candidates) :] if after else ())
    # An effect in the model's own inputs is reported at its full size, but the refit learns it.
    effects = tuple(
        estimated_effects(evidence, [t.best], of_size=True)[0][0] if t.own else next(added) for t in motion.terms
    )
    gain = held_out_gain(model, refit, after, evidence.table, context.held_out) if after else None
    return _Extension(held_out_windows(refit).calibrated(), after, effects, gain)


def _verdict(motion: MotionFinding, forces: WrenchFinding, shifted: Sequence[ShiftedInput]) -> Verdict:
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


def _rival_covariates(forces: WrenchFinding) -> tuple[str, ...]:
    """Rivals of the covariate that the force depends on first."""
    first = next(iter(forces.effects), None)
    return () if first is None else tuple(name for name in first.rivals if name != WRENCH_BIAS)


def _found_effects(
    context: _Context, motion: MotionFinding, forces: WrenchFinding, effects: Sequence[Effect]
) -> tuple[FoundEffect, ...]:
    """The effects on the channel that the verdict is about."""
    if motion.terms:
        return tuple(
            FoundEffect(
                term.mechanism,
                SESSION if term.since_training else term.best.covariate,
                term.outputs,
                term.best.basis.name,
                None if term.mechanism is None else size_of(effect, context.evidence.table),
                _of_trace(term.p_value, "motion"),
                term.share,
                term.naming.resembles,
            )
            for k, (term, effect) in enumerate(zip(motion.terms, effects, strict=True))
            if not any(left_by(earlier, term) for earlier in motion.terms[:k])
        )
    if motion.variance and not forces.effects:
        return tuple(
            FoundEffect(None, s.covariate, s.outputs, s.basis.name, None, _of_trace(s.p_value, "motion"), 0.0)
            for s in motion.variance
        )
    return tuple(
        FoundEffect(e.mechanism, e.covariate, (), e.basis, parameter, _of_trace(e.p_value, "wrench"), 0.0)
        for e in forces.effects
        for parameter in e.parameters
    )


# --- held-out pushes and levels ------------------------------------------------------------------------------------


def _held_out(context: _Context, refit: PushModel, after: PushModel, held: PushTable) -> HeldOut:
    """Held-out pushes by all three models; the last on `held`, which differs if the measurement was corrected."""
    mean, table = context.deployed.training_mean, context.held_out
    return HeldOut(
        table,
        compared(context.deployed, table, mean),
        compared(refit, table, mean),
        compared(after, held, mean),
        digest_of(table),
    )


def _family_wise(tested: Sequence[Tested], channel: str) -> tuple[Tested, ...]:
    return tuple(replace(one, p_value=_of_trace(one.p_value, channel)) for one in tested)


def _of_trace(p_value: float, channel: str) -> float:
    """A channel's p value as one of the whole trace: at most alpha exactly if it is at most the channel's share."""
    return min(1.0, p_value / SHARES[channel])


def _check(model: PushModel, table: PushTable, alpha: float, covariates: Sequence[str] | None) -> None:
    if not 0.0 < alpha < 1.0:
        raise RequestError("alpha", alpha, "a probability above 0 and below 1")
    if not len(model.training):
        raise RequestError("model", model.name, "one that was trained on pushes: retrain it on those at hand")
    if len(table.pushes) < FEWEST_PUSHES:
        raise RequestError("pushes", len(table.pushes), f"at least {FEWEST_PUSHES}, preferably hundreds")
    for name in covariates or ():
        if name not in table.covariates and name != "previous_residual":
            raise RequestError("covariate", name, f"one of {', '.join(sorted(table.covariates))}")
