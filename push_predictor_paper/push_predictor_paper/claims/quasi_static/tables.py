"""The quasi-static study's tables."""

from __future__ import annotations

import numpy as np

from push_predictor_paper.claims.quasi_static.facts import MAIN, SAME_SIZE, SERIES, Facts
from push_predictor_paper.claims.quasi_static.rules import KEPT, SLOW, departure, estimated
from push_predictor_paper.data.time_scaled import TRAVEL, WINDOWS
from push_predictor_paper.section import Table


def bracket_table(facts: Facts) -> Table:
    """NMSE by bracket."""
    judged = facts.judged
    curves = [judged.same(series) for series in SERIES] + [judged.slow(MAIN), judged.slow(SAME_SIZE)]
    rows = tuple(
        (
            f"up to {told(speed)}",
            str(facts.size(MAIN, k)),
            str(facts.size(SAME_SIZE, k)),
            *(estimated(curve[k]).cell(".3f") for curve in curves),
        )
        for k, speed in enumerate(judged.speeds)
    )
    caption = (
        f"Simulated: NMSE (sum of 3) by the speeds of the training pushes, {facts.rows} windows of each speed, or n "
        "in all (equal n). First four: on held-out pushes of the same speeds; last two: on pushes of up to "
        f"{told(SLOW)} only. {facts.judged_on} The paper shows the first as a curve, without numbers: lowest at 50 to "
        "80 mm/s."
    )
    slow = (f"slow pushes: {MAIN}", f"slow pushes: {SAME_SIZE}")
    return Table(caption, ("training pushes", "n", "equal n", *SERIES, *slow), rows)


def single_table(facts: Facts) -> Table:
    """NMSE at single speeds by bracket."""
    judged = facts.judged
    places = np.unique(np.linspace(0, len(judged.speeds) - 1, 5).round().astype(int)).tolist()
    rows = tuple(
        (f"up to {told(speed)}", *(estimated(judged.single(MAIN, k, place)).cell(".2f") for place in places))
        for k, speed in enumerate(judged.speeds)
    )
    caption = (
        "Simulated: NMSE (sum of 3) of the VHGP that is not told the speed, on held-out pushes of one speed; the "
        "spread is that about the mean of its training pushes. Intervals as above. All speeds: the map."
    )
    return Table(caption, ("training pushes", *(f"at {told(judged.speeds[p])}" for p in places)), rows)


def speed_table(facts: Facts) -> Table:
    """By speed: windows got and lost, departure from the slowest."""
    rows = []
    for speed, table, equal in zip(facts.speeds, facts.windows, facts.equal, strict=True):
        every, _ = departure(facts.equal[0], equal, False)
        kept, count = departure(facts.equal[0], equal, True)
        lost = WINDOWS * facts.pushes - len(table)
        rows.append((told(speed), str(len(table)), str(lost), every.cell(".3f"), str(count), kept.cell(".3f")))
    caption = (
        f"Simulated, by speed: windows of {1e3 * TRAVEL:.0f} mm got of {facts.pushes} pushes, {WINDOWS} each (a window "
        f"is lost where the tip touches on less than {KEPT:.0%} of it: the slider flies ahead or the tip slides off), "
        f"and the departure from the outcome at {told(facts.speeds[0])} of {facts.pushes} other pushes made alike at "
        "every speed, as in the finding, interval by push; first of all of them, then of those that kept in "
        "touch at both speeds: a selection."
    )
    head = ("speed", "windows", "lost", "departure, all pushes", "kept in touch", "departure, kept in touch")
    return Table(caption, head, tuple(rows))


def told(speed: float) -> str:
    """A speed in m/s with its unit."""
    return f"{1e3 * speed:.0f} mm/s"
