"""What a reader of a trace must know beside its verdict, in sentences."""

from __future__ import annotations

from push_predictor.residuals.channels.measurement import MeasurementFinding
from push_predictor.residuals.channels.motion import MotionFinding
from push_predictor.residuals.channels.wrench import WrenchFinding
from push_predictor.residuals.evidence.loading import Loaded
from push_predictor.residuals.evidence.split import RULE

CUT_AGAIN = (
    "The streams were put right and the windows cut again: `after` is the deployed model, unchanged, on the "
    "held-out pushes of the corrected recordings."
)


def notes_of(
    loaded: Loaded, motion: MotionFinding, measured: MeasurementFinding | None, forces: WrenchFinding
) -> tuple[str, ...]:
    """Notes on the data, and on what was found or not tried beside the verdict."""
    notes = [*notes_of_data(loaded)]
    if motion.deviation is not None:
        told = ", ".join(f"{value:.2f}" for value in motion.deviation)
        notes.append(f"Standardised residuals of training pushes, by models that had not seen them: deviation {told}.")
    if any(term.own for term in motion.terms):
        what = ", ".join(f"{t.mechanism or 'the unknown one'} by {t.covariate}" for t in motion.terms if t.own)
        notes.append(f"In the model's own inputs, so that a model trained anew on such pushes has it: {what}.")
    if motion.entangled:
        notes.append(
            f"Not tried, because in these pushes they go with contact, angle and speed: {', '.join(motion.entangled)}. "
            "Push in an order that is mixed."
        )
    if motion.standing:
        notes.append(
            f"The model lacks, but lacked in training as much, so that it is nothing new: {', '.join(motion.standing)}."
        )
    if measured is not None and measured.errors:
        what = ", ".join(error.mechanism for error in measured.errors)
        notes.append(f"The gap between tip and slider looks like {what}; but that put right, the model is as far off.")
    if measured is None:
        notes.append("The measurement itself could not be judged: these windows have no contact gap or pose.")
    if motion.terms and forces.effects:
        what = ", ".join(f"{e.mechanism} by {e.covariate}" for e in forces.effects)
        notes.append(f"On the force's channel, beside: {what}.")
    return tuple(notes)


def notes_of_data(loaded: Loaded) -> tuple[str, ...]:
    """How the pushes were split, and what of the data was left out."""
    left_out = (f"{name} was left out: {why}." for name, why in loaded.left_out.items())
    return (f"Split: {RULE}. Windows of one push stay together.", *left_out)
