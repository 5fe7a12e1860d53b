# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How to push so that covariates which these data cannot distinguish become distinguishable."""

from __future__ import annotations

from collections.abc import Sequence

from push_predictor.models.effects.covariate_range import CUMULATIVE
from push_predictor.residuals.outcome import FoundEffect
from push_predictor.residuals.reporting.phrases import covariate_phrase, listed

HEADED = ("slider_heading", "push_heading", "edge")
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
    (
        CUMULATIVE,
        ("velocity", "angle", "contact"),
        "Randomise speed, push angle and contact point over the session.",
    ),
    (CUMULATIVE, ("dwell_time",), "Randomise the pause before each push over the session."),
    (
        CUMULATIVE,
        ("recording",),
        "Repeat the setting of an early recording in a new one: an effect of the setting recurs, a drift does not.",
    ),
)


ANEW = "To decide, restore the rig to its state at the start of the session, and push again."


def grew_early(effect: FoundEffect, equivalent: Sequence[str]) -> bool:
    """Whether all that rivals a constant effect is that it grew early in the session."""
    return effect.basis == "constant" and bool(equivalent) and {*equivalent} <= {*CUMULATIVE}


def separating_words(rivals: Sequence[str]) -> list[str]:
    """Advice on pushes that separate these covariates."""
    advice = [text for one, other, text in ADVICE if len({*one, *other} & {*rivals}) > 1 and _both(one, other, rivals)]
    names = listed([covariate_phrase(name) for name in rivals])
    return advice or [f"Vary {names} independently: change one while the others stay constant."]


def _both(one: Sequence[str], other: Sequence[str], rivals: Sequence[str]) -> bool:
    return bool({*one} & {*rivals} and {*other} & {*rivals})
