# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The plain phrase for every mechanism, covariate and unit: identifiers belong in tables and JSON, not in prose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.models.request import UNITS
from push_predictor.reporting.html import number
from push_predictor.residuals.evidence.drivers import CONSTANT, SESSION, UNDRIVEN


@dataclass(frozen=True)
class MechanismPhrase:
    """How prose names a mechanism: `noun` is what changes; `onset` is a clause for a change at one point, if apt."""

    noun: str
    onset: str = ""


MECHANISMS: dict[str | None, MechanismPhrase] = {
    None: MechanismPhrase("the slider's motion"),
    "contact_friction": MechanismPhrase("contact friction"),
    "contact_asymmetry": MechanismPhrase("the difference between contact friction to the left and to the right"),
    "pressure_spread": MechanismPhrase("the spread of the slider's pressure on the table"),
    "centre_of_friction": MechanismPhrase("the slider's centre of friction"),
    "pushing_height": MechanismPhrase("the pushing height"),
    "body_anisotropy": MechanismPhrase(
        "direction-dependent friction of the slider", "the slider's friction became direction-dependent"
    ),
    "anisotropic_friction": MechanismPhrase(
        "direction-dependent friction of the table", "the table's friction became direction-dependent"
    ),
    "friction_gradient": MechanismPhrase("the friction gradient across the table"),
    "tilted_surface": MechanismPhrase("the tilt of the table"),
    "inertia": MechanismPhrase("the slider's inertia"),
    "pusher_radius": MechanismPhrase("the pusher's radius"),
    "pusher_travel": MechanismPhrase("the distance that the pusher travels"),
    "friction_by_angle": MechanismPhrase("the change of contact friction with the push angle"),
    "friction_by_speed": MechanismPhrase("the change of contact friction with sliding speed"),
    "friction_by_load": MechanismPhrase("the change of contact friction with the normal force"),
    "rim_pressure": MechanismPhrase("the growth of the slider's pressure towards its rim"),
    "outline_shift": MechanismPhrase("the position of the slider's outline in its tracked frame"),
    "tip_offset": MechanismPhrase("the offset of the pusher's tip"),
    "outline_rotation": MechanismPhrase("the rotation of the slider's outline in its tracked frame"),
    "push_rotation": MechanismPhrase("the rotation of the recorded push direction"),
    "surface_friction": MechanismPhrase("the force needed to push the slider"),
    "wrench_bias": MechanismPhrase("a bias of the force sensor"),
    "clock_offset": MechanismPhrase("a clock offset between tracker and robot"),
    "frame_rotation": MechanismPhrase("a rotation of the tracker's frame"),
    "frame_shift": MechanismPhrase("a shift of the tracker's frame"),
    "tool_offset": MechanismPhrase("an offset of the tool point"),
}

COVARIATES: dict[str, str] = {
    "elapsed_time": "elapsed time",
    "push_index": "push count",
    "slid_distance": "distance slid",
    "slider_x": "the slider's x position",
    "slider_y": "the slider's y position",
    "slider_heading": "the slider's heading",
    "push_heading": "the push direction in the world",
    "velocity": "pushing speed",
    "contact": "contact point",
    "angle": "push angle",
    "edge": "side pushed",
    "dwell_time": "dwell time before the push",
    "time_since_contact": "time since first contact",
    "contact_gap": "measured gap at the contact",
    "normal_force": "normal force",
    "tangential_force": "tangential force",
    "free_force_x": "the force read in free motion along x",
    "free_force_y": "the force read in free motion along y",
    "previous_residual": "the residual of the previous push",
    "recording": "recording",
    "travel": "length of the push",
    SESSION: "the session (since training)",
    CONSTANT: "nothing (constant)",
}

SHOWN = {
    **dict.fromkeys(("slider_heading", "push_heading", "angle"), (float(np.degrees(1.0)), "deg")),
    "velocity": (1e3, "mm/s"),
    "contact_gap": (1e3, "mm"),
}


def mechanism_phrase(mechanism: str | None) -> str:
    """A mechanism as a noun phrase; "an unknown mechanism" for None."""
    if mechanism is None:
        return "an unknown mechanism"
    known = MECHANISMS.get(mechanism)
    return known.noun if known else mechanism.replace("_", " ")


def moved_noun(mechanism: str | None) -> str:
    """What changes if a mechanism acts: a noun phrase to begin a sentence with."""
    return MECHANISMS[None].noun if mechanism is None else mechanism_phrase(mechanism)


def covariate_phrase(covariate: str) -> str:
    """A covariate in words; a recorded topic by its name."""
    if covariate.startswith("topic:"):
        return f"topic {covariate.removeprefix('topic:')}"
    return COVARIATES.get(covariate, covariate.replace("_", " "))


def effect_phrase(mechanism: str | None, covariate: str) -> str:
    """An effect as a noun phrase: mechanism and covariate."""
    if covariate in UNDRIVEN:
        return f"{mechanism_phrase(mechanism)} (constant)"
    return f"{mechanism_phrase(mechanism)} (depends on {covariate_phrase(covariate)})"


def step_phrase(covariate: str, place: float) -> str:
    """Where or when a step sets in, to follow a verb."""
    if covariate == "elapsed_time":
        return f"{place_of_step(covariate, place)} into the session"
    if covariate == "push_index":
        return f"after {place_of_step(covariate, place)}"
    if covariate == "slid_distance":
        return f"after {number(place, 3)} m of sliding"
    return f"where {covariate_phrase(covariate)} exceeds {place_of_step(covariate, place)}"


def place_of_step(covariate: str, place: float) -> str:
    """The place of a step with its unit, to follow "before" or "after"."""
    if covariate == "elapsed_time":
        return f"{place:.0f} s"
    if covariate == "push_index":
        return f"push {np.floor(place):.0f}"
    if covariate == "slid_distance":
        return f"{number(place, 3)} m slid"
    factor, unit = shown_unit_of(covariate)
    return f"{number(factor * place, 3)} {unit}".rstrip()


def listed(phrases: Sequence[str]) -> str:
    """Phrases as a list in a sentence."""
    *first, last = phrases
    return f"{', '.join(first)} and {last}" if first else last


def label(phrase: str) -> str:
    """A phrase as the label of an axis: without its article, capitalised."""
    return capitalised(bare(phrase))


def bare(phrase: str) -> str:
    """A phrase without its article, for the cell of a table."""
    return phrase.removeprefix("the ").removeprefix("an ").removeprefix("a ")


def capitalised(text: str) -> str:
    """A text with its first letter in upper case."""
    return text[:1].upper() + text[1:]


def unit_of(covariate: str) -> str:
    """The unit of a covariate, empty if none is known."""
    return "m" if covariate == "travel" else UNITS.get(covariate, "")


def shown_unit_of(covariate: str) -> tuple[float, str]:
    """The factor to, and the name of, the unit in which pictures and sentences show a covariate."""
    return SHOWN.get(covariate, (1.0, unit_of(covariate)))


def with_unit(covariate: str) -> str:
    """A covariate with its unit, for the axis of a picture or the head of a table."""
    unit, phrase = unit_of(covariate), label(covariate_phrase(covariate))
    return f"{phrase} ({unit})" if unit else phrase
