"""How to push so that drivers which these data cannot tell apart go separate ways."""

from __future__ import annotations

from collections.abc import Sequence

DRIFTING = ("elapsed_time", "push_index", "slid_distance")
HEADED = ("slider_heading", "push_heading", "edge")
ADVICE: tuple[tuple[tuple[str, ...], tuple[str, ...], str], ...] = (  # for two rivals, one of each kind
    (
        DRIFTING,
        DRIFTING,
        "Rest the rig for a good part of the session's length and push on: the time runs, count and way do not. Then "
        "push short and long pushes in turn: the way grows faster than the count.",
    ),
    (
        DRIFTING,
        ("slider_x", "slider_y"),
        "Return to places where the slider was early on: what goes with the place comes back, what drifts does not.",
    ),
    (
        HEADED,
        HEADED,
        "Set the slider at many headings and push from every side at each: side, slider's heading and push's heading "
        "part.",
    ),
    (DRIFTING, ("velocity", "angle", "contact"), "Mix speeds, angles and contacts at random over the session."),
    (DRIFTING, ("dwell_time",), "Vary the pause before a push at random over the session."),
    (
        DRIFTING,
        ("recording",),
        "Repeat the setting of an early recording in a new one: what belongs to the setting comes back, a drift does "
        "not.",
    ),
)


def separating_words(rivals: Sequence[str]) -> list[str]:
    """How pushes tell these drivers apart."""
    advice = [text for one, other, text in ADVICE if len({*one, *other} & {*rivals}) > 1 and _both(one, other, rivals)]
    return advice or [f"Change one of {', '.join(rivals)} while the others stay, and then the next."]


def _both(one: Sequence[str], other: Sequence[str], rivals: Sequence[str]) -> bool:
    return bool({*one} & {*rivals} and {*other} & {*rivals})
