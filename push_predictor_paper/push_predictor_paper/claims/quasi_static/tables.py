# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of the quasi-static claim."""

from __future__ import annotations

import numpy as np

from push_predictor_paper.claims.quasi_static.facts import MAIN, SAME_SIZE, SERIES, Facts
from push_predictor_paper.claims.quasi_static.rules import KEPT, SLOW, departure, estimated
from push_predictor_paper.data.time_scaled import TRAVEL, WINDOWS
from push_predictor_paper.section import Table


def bracket_table(facts: Facts) -> Table:
    """NMSE by bracket of speeds."""
    judged = facts.judged
    curves = [judged.same(series) for series in SERIES] + [judged.slow(MAIN), judged.slow(SAME_SIZE)]
    rows = tuple(
        (
            f"up to {speed_text(speed)}",
            str(facts.size(MAIN, k)),
            str(facts.size(SAME_SIZE, k)),
            *(estimated(curve[k]).cell(".3f") for curve in curves),
        )
        for k, speed in enumerate(judged.speeds)
    )
    caption = (
        f"NMSE (sum of 3) by the top speed of the training pushes. Simulated; {facts.rows} windows of each speed, or "
        "n in all (equal n). First four: on held-out pushes of the same speeds; last two: on pushes of up to "
        f"{speed_text(SLOW)} only. {facts.judged_on} The paper shows the first as a curve, lowest at 50 to 80 mm/s, "
        "without numbers."
    )
    slow = (f"slow pushes: {MAIN}", f"slow pushes: {SAME_SIZE}")
    return Table(caption, ("training pushes", "n", "equal n", *SERIES, *slow), rows)


def single_table(facts: Facts) -> Table:
    """NMSE at single speeds, by bracket."""
    judged = facts.judged
    places = np.unique(np.linspace(0, len(judged.speeds) - 1, 5).round().astype(int)).tolist()
    rows = tuple(
        (f"up to {speed_text(speed)}", *(estimated(judged.single(MAIN, k, place)).cell(".2f") for place in places))
        for k, speed in enumerate(judged.speeds)
    )
    caption = (
        "NMSE (sum of 3) of the VHGP without the speed as an input, on held-out pushes of one speed. Simulated; the "
        "variance is about the mean of its training pushes. Intervals as above. All speeds: see the map."
    )
    return Table(caption, ("training pushes", *(f"at {speed_text(judged.speeds[p])}" for p in places)), rows)


def speed_table(facts: Facts) -> Table:
    """By speed: windows found and lost, departure from the slowest."""
    rows = []
    for speed, table, equal in zip(facts.speeds, facts.windows, facts.equal, strict=True):
        every, _ = departure(facts.equal[0], equal, False)
        kept, count = departure(facts.equal[0], equal, True)
        lost = WINDOWS * facts.pushes - len(table)
        rows.append((speed_text(speed), str(len(table)), str(lost), every.cell(".3f"), str(count), kept.cell(".3f")))
    caption = (
        f"Windows and departure by speed. Simulated: windows of {1e3 * TRAVEL:.0f} mm found in {facts.pushes} pushes, "
        f"{WINDOWS} each. A window is lost if the tip touches on less than {KEPT:.0%} of it, because the slider flies "
        f"ahead or the tip slides off. Departure from the outcome at {speed_text(facts.speeds[0])}: of {facts.pushes} "
        "other pushes repeated at every speed, interval by push; then of those that stayed in contact at both speeds."
    )
    head = ("speed", "windows", "lost", "departure, all pushes", "in contact", "departure, in contact")
    return Table(caption, head, tuple(rows))


def speed_text(speed: float) -> str:
    """A speed in m/s with its unit."""
    return f"{1e3 * speed:.0f} mm/s"
