"""Trace the residual of a deployed model to an effect that the model lacks, add it, and measure again.

The order is that of trust: an error of measurement is put right before anything is said about motion; a motion effect
before the scatter; the force's channel by itself. The held-out pushes are opened once, at the end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.evaluation.offline import window_options
from push_predictor.models.effects.effect import Effect
from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.channels.corrections import NO_STREAMS, correct
from push_predictor.residuals.channels.measurement import MeasurementFault, MeasurementFinding, measurement_errors
from push_predictor.residuals.channels.motion import MotionFinding, MotionTerm, motion_effects
from push_predictor.residuals.channels.wrench import WRENCH_BIAS, WrenchFinding, wrench_effects
from push_predictor.residuals.evidence.drivers import CONSTANT
from push_predictor.residuals.evidence.loading import Loaded, cut_anew, load_evidence, previous_residual
from push_predictor.residuals.evidence.split import digest_of, held_out_rows
from push_predictor.residuals.evidence.standardised import evidence_of, physics_of
from push_predictor.residuals.extension.effect_size import size_of
from push_predictor.residuals.extension.extended_model import Term, compared, estimate, extend, gain, refit_base
from push_predictor.residuals.outcome import FoundEffect, Gain, HeldOut, Tested, Trace, Verdict
from push_predictor.residuals.reporting.notes import CUT_AGAIN, notes_of, notes_of_data

FEWEST_PUSHES = 12
SHARES = {"motion": 0.6, "measurement": 0.2, "wrench": 0.2}  # of alpha: every kind of false alarm counts
BADLY_OFF = 0.5  # excess of the squared residuals from which a correction of the measurement must show in them
Watch = Callable[[str, float], None]
NO_GAIN = Gain(0.0, 0.0, 0.0)


def no_watch(stage: str, done: float) -> None:
    """Nobody is waiting."""


def trace_data(
    paths: Sequence[Path | str],
    model_path: Path | str,
    *,
    alpha: float = 0.01,
    covariates: Sequence[str] | None = None,
    rig: Rig | None = None,
    seed: int = 0,
    watch: Watch = no_watch,
) -> Trace:
    """Judge a model file on recordings or push tables that it was not trained on; see `trace`."""
    watch("windows", 0.0)
    model = load_model(Path(model_path))
    loaded = load_evidence([Path(path) for path in paths], rig, window_options(model))
    return trace(model, loaded, alpha=alpha, covariates=covariates, seed=seed, watch=watch)


def trace(
    model: PushModel,
    loaded: Loaded,
    *,
    alpha: float = 0.01,
    covariates: Sequence[str] | None = None,
    seed: int = 0,
    watch: Watch = no_watch,
) -> Trace:
    """Find what the model leaves over in these windows and what drives it.

    alpha: probability of any false alarm where there is nothing. covariates: drivers to try, all recorded ones if None.
    watch: told of each stage, and which share of the work is done, when it begins.
    Raises RequestError for an alpha outside (0, 1), a covariate that is not recorded, or too few pushes.
    """
    _check(loaded.table, alpha, covariates)
    context = _Context.of(model, loaded, alpha, covariates, seed)
    training, physics = model.training, physics_of(model)
    watch("measurement", 0.1)
    measured = measurement_errors(context.analysis, training, loaded.rig, context.share("measurement"), seed)
    if measured is not None and measured.errors:
        corrected = _cut_again(context, measured)
        if _puts_right(context, corrected):
            return _of_measurement(context, measured, corrected)
    watch("motion", 0.15)
    motion = motion_effects(model, context.analysis, context.share("motion"), context.covariates, seed)
    watch("force", 0.6)
    forces = wrench_effects(context.analysis, training, physics, context.share("wrench"), seed)
    watch("extended model", 0.7)
    biased = _biased(forces) if not motion.terms and not motion.scatter else None
    if biased is not None:
        return _of_measurement(context, biased, _cut_again(context, biased))
    return _of_motion(context, motion, measured, forces)


@dataclass(frozen=True, eq=False)
class _Context:
    """A trace's question, and its data, split once. analysis: what is searched; held_out: opened at the end."""

    model: PushModel
    loaded: Loaded
    alpha: float
    covariates: tuple[str, ...] | None
    seed: int
    analysis: PushTable
    held_out: PushTable

    @classmethod
    def of(
        cls, model: PushModel, loaded: Loaded, alpha: float, covariates: Sequence[str] | None, seed: int
    ) -> _Context:
        """Split the windows, the residual of the push before among their covariates."""
        table = loaded.table
        z = evidence_of(model, table, physics_of(model)).z
        table = replace(table, covariates={**table.covariates, "previous_residual": previous_residual(table, z)})
        held = held_out_rows(table)
        names = None if covariates is None else tuple(covariates)
        return cls(model, loaded, alpha, names, seed, table.take(~held), table.take(held))

    def share(self, channel: str) -> float:
        """The part of alpha that a channel may spend."""
        return SHARES[channel] * self.alpha


def _puts_right(context: _Context, corrected: PushTable | None) -> bool:
    """Whether the model, where it is badly off, is much less so once the measurement is corrected.

    A tip that gives way opens the gap as a clock that is late does; but no correction brings the predictions back.
    Where there are no streams to correct, or the model is hardly off, the gap decides alone.
    """
    if corrected is None:
        return True
    before, after = (_excess(context.model, t) for t in (context.analysis, corrected.take(~held_out_rows(corrected))))
    return before < BADLY_OFF or after < 0.5 * before


def _excess(model: PushModel, table: PushTable) -> float:
    """By how much squared residuals, in units of the prediction, exceed their 1; wild ones count 25."""
    z = evidence_of(model, table, physics_of(model)).z
    return float(np.mean(np.minimum(z**2, 25.0))) - 1.0


def _of_motion(
    context: _Context, motion: MotionFinding, measured: MeasurementFinding | None, forces: WrenchFinding
) -> Trace:
    model, terms = context.model, [_as_term(t) for t in motion.terms if not t.own]
    refit = refit_base(model, context.analysis)
    after = extend(refit, context.analysis, terms, model) if terms else refit
    added = iter(
        after.predictor.effects[-len(terms) :] if terms and isinstance(after.predictor, ExtendedPredictor) else ()
    )
    effects = tuple(_as_seen(t, context) if t.own else next(added) for t in motion.terms)
    equivalent = motion.equivalent if motion.terms or motion.scatter else _drivers(forces)
    nmse, nlpd = gain(refit, after, context.held_out, model.training_mean) if terms else (NO_GAIN, NO_GAIN)
    return Trace(
        verdict=_verdict(motion, forces),
        kind="mean" if motion.terms else "variance" if motion.scatter else None,
        model=model,
        effects=_told(motion, forces, effects, context),
        terms=effects,
        equivalent=equivalent,
        mechanisms=motion.mechanisms,
        undecided=bool(equivalent),
        analysis=context.analysis,
        residual=motion.residual,
        left=evidence_of(after, context.analysis, physics_of(model)).z,
        held_out=_held_out(context, model, refit, after, context.held_out),
        gain_nmse=nmse,
        gain_nlpd=nlpd,
        extended=after if terms and nlpd.high < 0.0 else None,
        tested=(
            *_family_wise(motion.tested, "motion"),
            *_family_wise(measured.tested if measured else (), "measurement"),
            *_family_wise(forces.tested, "wrench"),
        ),
        minimum_detectable=motion.minimum_detectable,
        remaining=motion.remaining,
        experiment=motion.experiment,
        alpha=context.alpha,
        notes=notes_of(context.loaded, motion, measured, forces),
    )


def _verdict(motion: MotionFinding, forces: WrenchFinding) -> Verdict:
    if motion.terms:
        if motion.terms[0].mechanism is None:
            return "driver_only"
        return "mechanism_only" if motion.equivalent else "effect"
    if motion.scatter:
        return "variance"
    return "wrench_only" if forces.effects else "none"


def _biased(forces: WrenchFinding) -> MeasurementFinding | None:
    """A bias of the force sensor is an error of measurement, though it is found on the force's channel."""
    first = next(iter(forces.effects), None)
    if first is None or first.mechanism != WRENCH_BIAS:
        return None
    size = float(np.linalg.norm([parameter.value for parameter in first.parameters]))
    error = MeasurementFault(first.mechanism, first.parameters, first.p_value, first.rivals, size)
    return MeasurementFinding((error,), forces.tested, forces.scatter, forces.against_training)


def _drivers(forces: WrenchFinding) -> tuple[str, ...]:
    """Rivals of what drives the force first."""
    first = next(iter(forces.effects), None)
    return () if first is None else tuple(name for name in first.rivals if name != WRENCH_BIAS)


def _told(
    motion: MotionFinding, forces: WrenchFinding, effects: tuple[Effect, ...], context: _Context
) -> tuple[FoundEffect, ...]:
    """What was found on the channel that the verdict is about."""
    if motion.terms:
        sizes = [size_of(effect, context.analysis) for effect in effects]
        return tuple(
            FoundEffect(t.mechanism, t.covariate, t.outputs, t.form.name, size, _of_all(t.p_value, "motion"), t.share)
            for t, size in zip(motion.terms, sizes, strict=True)
        )
    if motion.scatter:
        return tuple(
            FoundEffect(None, s.covariate, s.outputs, s.form.name, None, _of_all(s.p_value, "motion"), 0.0)
            for s in motion.scatter
        )
    return tuple(
        FoundEffect(e.mechanism, e.covariate, (), e.form, parameter, _of_all(e.p_value, "wrench"), 0.0)
        for e in forces.effects
        for parameter in e.parameters
    )


def _as_term(term: MotionTerm) -> Term:
    return term.mechanism, term.covariate, term.form


def _as_seen(term: MotionTerm, context: _Context) -> Effect:
    """An effect in the model's own inputs, at its whole size; a refit takes it over, so that no model is given it."""
    evidence = evidence_of(context.model, context.analysis, physics_of(context.model))
    return estimate(evidence, [_as_term(term)])[0][0]


def _of_measurement(context: _Context, measured: MeasurementFinding, corrected: PushTable | None) -> Trace:
    """The error told and, where there are streams, put right in them: the same pushes cut again, the model as it is."""
    model = context.model
    refit = refit_base(model, context.analysis)
    held = context.held_out if corrected is None else corrected.take(held_out_rows(corrected))
    left = evidence_of(model, context.analysis if corrected is None else corrected.take(~held_out_rows(corrected)),
                       physics_of(model)).z  # fmt: skip
    evidence = evidence_of(model, context.analysis, physics_of(model))
    first = measured.errors[0]
    return Trace(
        verdict="measurement",
        kind="mean",
        model=model,
        effects=tuple(
            FoundEffect(e.mechanism, CONSTANT, (), "constant", parameter, _of_all(e.p_value, "measurement"), 0.0)
            for e in measured.errors
            for parameter in e.parameters
        ),
        terms=(),
        equivalent=(),
        mechanisms=first.rivals,
        undecided=bool(first.rivals),
        analysis=context.analysis,
        residual=evidence.z,
        left=left,
        held_out=_held_out(context, model, refit, model, held),
        gain_nmse=NO_GAIN,
        gain_nlpd=NO_GAIN,
        extended=None,
        tested=_family_wise(measured.tested, "measurement"),
        minimum_detectable={},
        remaining=None,
        experiment=(),
        alpha=context.alpha,
        notes=(NO_STREAMS if corrected is None else CUT_AGAIN, *notes_of_data(context.loaded)),
    )


def _cut_again(context: _Context, measured: MeasurementFinding) -> PushTable | None:
    """The table of the recordings with their streams put right, error by error; None where there are no recordings."""
    if context.loaded.recordings is None:
        return None
    righted = list(context.loaded.recordings)
    for error in measured.errors:
        righted = [correct(recording, error.mechanism, error.values) for recording in righted]
    return cut_anew(righted, context.loaded.rig, window_options(context.model))


def _held_out(context: _Context, model: PushModel, refit: PushModel, after: PushModel, held: PushTable) -> HeldOut:
    """Held-out pushes by all three; after on `held`, which differs where the measurement was put right."""
    mean, before = model.training_mean, context.held_out
    return HeldOut(
        before,
        compared(model, before, mean),
        compared(refit, before, mean),
        compared(after, held, mean),
        digest_of(before),
    )


def _family_wise(tested: Sequence[Tested], channel: str) -> tuple[Tested, ...]:
    return tuple(replace(one, p_value=_of_all(one.p_value, channel)) for one in tested)


def _of_all(p_value: float, channel: str) -> float:
    """A channel's p value as one of the whole trace: at most alpha where the channel, with its share, finds it."""
    return min(1.0, p_value / SHARES[channel])


def _check(table: PushTable, alpha: float, covariates: Sequence[str] | None) -> None:
    if not 0.0 < alpha < 1.0:
        raise RequestError("alpha", alpha, "a probability above 0 and below 1")
    if len(table.pushes) < FEWEST_PUSHES:
        raise RequestError("pushes", len(table.pushes), f"{FEWEST_PUSHES} at the least, better hundreds")
    for name in covariates or ():
        if name not in table.covariates and name != "previous_residual":
            raise RequestError("covariate", name, f"one of {', '.join(sorted(table.covariates))}")
