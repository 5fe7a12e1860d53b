# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Rival explanations of a trace in sentences, and advice on pushes that separate them."""

from __future__ import annotations

from collections.abc import Sequence

from push_predictor.models.effects.covariates import CUMULATIVE, HEADINGS
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting import phrases as say

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


def rivals(trace: Trace) -> str:
    """The covariates and mechanisms that fit as well; empty without any."""
    found = []
    if trace.effects and grew_early(trace):
        found.append("It was there from the first push, or it grew early in the session: these pushes do not decide.")
    elif trace.equivalent:
        names = [say.covariate_phrase(name) for name in (trace.effects[0].covariate, *trace.equivalent)]
        found.append(f"{say.capitalised(say.listed(names))} fit equally well.")
    if trace.mechanisms:
        names = [say.mechanism_phrase(name) for name in trace.mechanisms]
        found.append(f"{say.capitalised(say.listed(names))} would explain these pushes as well.")
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
