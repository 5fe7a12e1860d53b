# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Three kinds of repeated push: convergent, divergent, multi-modal."""

from __future__ import annotations

from typing import Any

import numpy as np

from push_predictor.reporting.canvas import Picture, draw
from push_predictor_paper.claims.repeated_pushes.kinds_of_push_rules import (
    APART,
    EDGE,
    FAR,
    LEAST_TRAVEL,
    LEVEL,
    POWER,
    STILL,
    STILL_TURN,
    STOPPED,
    Figure,
    Kinds,
    apart,
    draws_together_fans_out,
    final_spread,
    growth,
    has_modes,
    kinds_of,
    relative_spread,
    resampled,
    travel,
)
from push_predictor_paper.claims.repeated_pushes.kinds_of_push_table import kinds_table, place_of, three
from push_predictor_paper.data.repetitions import RepeatedGrid
from push_predictor_paper.estimate import Estimate, of_draws
from push_predictor_paper.figures.trajectories import Trajectories, paint_trajectories
from push_predictor_paper.plan import GRID_SPEED
from push_predictor_paper.section import Finding, Section
from push_predictor_paper.statistics.densities import found_at
from push_predictor_paper.study import Study


def section(study: Study) -> Section:
    """Choose a push of each kind, draw its trajectories, and test whether the kinds exist."""
    grid = study.reference_grid
    kinds = kinds_of(grid)
    notes = NOTES if not study.measured else (*NOTES, "The measured sets have no grid of repeated pushes.")
    if kinds is None:
        note = f"Fewer than two pushes of the grid moved the slider by {1e3 * LEAST_TRAVEL:.0f} mm and up to their end."
        return Section("kinds_of_push", TITLE, (Finding(CLAIM_KINDS, "not decided", note),), notes=(note, *notes))
    return Section(
        key="kinds_of_push",
        title=TITLE,
        findings=(_growth_finding(kinds), _apart_finding(kinds), _modes_finding(kinds)),
        tables=(kinds_table(grid, kinds),),
        pictures=(_picture(study, grid, kinds),),
        notes=notes,
        data=_json(kinds),
    )


TITLE = "Three kinds of push"
CLAIM_KINDS = "Some repeated pushes are convergent (their paths draw together), others divergent (they fan out)"
CLAIM_APART = "Divergent pushes end further apart than convergent ones"
CLAIM_MODES = "Some repeated pushes are multi-modal"
NOTES = (
    "Spread: root mean square distance of the slider's centre from its mean. Relative spread: spread at the end over "
    "the mean displacement. Paths are relative to the slider's pose at the first contact, so all begin together: they "
    "show how paths part, not whether differences at the start vanish.",
    f"Only pushes that move the slider by {1e3 * LEAST_TRAVEL:.0f} mm or more, that begin at least {EDGE:g} of the "
    f"side from its ends, and of which at most {STOPPED:.0%} of the repetitions stop early (less than "
    f"{1e3 * STILL:.1f} mm and {np.degrees(STILL_TURN):.1f}° in the last 0.1 s: the tip slid off).",
    "Growth: relative spread at the end over that half-way. Convergent: least growth; divergent: largest. Every second "
    "repetition chooses the push, the others test it; otherwise the extremes of many noisy values would look too "
    "extreme.",
    "Multi-modal: least p of the dip test on the final poses (x, y or rotation), family-wise by Holm's correction over "
    "all pushes and the three outputs.",
    "Repetitions in which the slider moves further within 20 ms than the tip could push it are dropped: there the path "
    "runs into the reset after the push.",
    "Why simulated repetitions part is a property of the simulator, whose friction and pressure vary over table and "
    "slider. It proves nothing about a real rig. The paper shows its three pushes without numbers.",
)


def _growth_finding(kinds: Kinds) -> Finding:
    narrow, wide = (of_draws(*resampled(kinds.paths[k][1::2], growth)) for k in (kinds.convergent, kinds.divergent))
    middle = np.quantile([growth(paths) for paths in kinds.paths], [0.1, 0.5, 0.9])
    return Finding(
        CLAIM_KINDS,
        draws_together_fans_out(narrow, wide),
        f"Growth (1: straight rays; below: drawn together; above: fanned out): {narrow.text()} for the most convergent "
        f"push, {wide.text()} for the most divergent one, by {_counts(kinds)} repetitions that did not choose them. Of "
        f"all {len(kinds.paths)} pushes a tenth lies below {middle[0]:.2f}, half below {middle[1]:.2f}, a tenth above "
        f"{middle[2]:.2f}. Rule: holds if the first interval lies below 1 and the second above; in part if one does; "
        "does not hold if neither does and one lies on the other side.",
        number=f"growth {narrow.text()} and {wide.text()}",
    )


def _apart_finding(kinds: Kinds) -> Finding:
    ratios = [_ratio(kinds, figure) for figure in (final_spread, relative_spread)]
    narrow, wide = (
        f"{1e3 * float(final_spread(paths)):.2f} mm ({relative_spread(paths):.0%})"
        for paths in (kinds.paths[k][1::2] for k in (kinds.convergent, kinds.divergent))
    )
    return Finding(
        CLAIM_APART,
        apart(ratios),
        f"The repetitions of the most divergent push end {ratios[0].text()} times as far apart as those of the most "
        f"convergent one; relative to the displacement, {ratios[1].text()} times. Spreads: {wide} and {narrow}, by "
        f"{_counts(kinds, True)} repetitions that did not choose them, resampled for the interval. Rule: holds if both "
        f"intervals lie above {APART:.0f}; in part if both lie above 1; does not hold if one contains 1 and ends below "
        f"{APART:.0f}.",
        number=f"{ratios[0].text()} times as far apart",
    )


def _ratio(kinds: Kinds, figure: Figure) -> Estimate:
    narrow, narrow_draws = resampled(kinds.paths[kinds.convergent][1::2], figure, 0)
    wide, wide_draws = resampled(kinds.paths[kinds.divergent][1::2], figure, 1)
    return of_draws(wide / narrow, wide_draws / narrow_draws)


def _modes_finding(kinds: Kinds) -> Finding:
    least, repetitions = float(kinds.p.min()), int(np.median([len(p) for p in kinds.paths]))
    power, _ = found_at(FAR, repetitions, kinds.p.size, LEVEL)
    count = int((kinds.p <= LEVEL).any(axis=1).sum())
    return Finding(
        CLAIM_MODES,
        has_modes(least, power),
        f"{count} of {len(kinds.p)} pushes that move the slider have final poses with more than one mode, 5 % "
        f"family-wise. The push shown has the least p of the dip test, {least:.2g} after correction for choosing it. "
        f"Two equal modes {FAR:.0f} of their sd apart would be found in {power:.0%} of cases at {repetitions} "
        f"repetitions. Rule: holds if that p is at most {LEVEL}; does not hold if it is larger, although such modes "
        f"are found in {POWER:.0%} of cases; else not decided.",
        number=f"{count} of {len(kinds.p)} pushes",
    )


def _counts(kinds: Kinds, divergent_first: bool = False) -> str:
    order = (kinds.divergent, kinds.convergent) if divergent_first else (kinds.convergent, kinds.divergent)
    return " and ".join(str(len(kinds.paths[k][1::2])) for k in order)


def _picture(study: Study, grid: RepeatedGrid, kinds: Kinds) -> Picture:
    shown = [
        Trajectories(f"{name}: {place_of(kinds.cells[k])}", kinds.cells[k].inputs.mean(axis=0), kinds.paths[k])
        for name, k, _ in three(kinds)
    ]
    path = draw(
        study.out / "kinds_of_push.png", (10.0, 9.0), lambda figure: paint_trajectories(figure, grid.rig, shown)
    )
    counts = ", ".join(str(len(one.paths)) for one in shown)
    return Picture(
        path,
        "Trajectories of the most convergent push, the most divergent one, and the one with the largest dip",
        f"Simulated, {grid.shape} on {grid.surface}: all repetitions ({counts}) of three pushes of 1 cm at "
        f"{1e3 * GRID_SPEED:.0f} mm/s. c: contact as a fraction of the side; angle from its normal. Above: slider at "
        "the start, tip and its path (grey), trajectories of the slider's centre (green). Middle: the same "
        "trajectories. Below: final poses (dots) about their mean, with the 95 % ellipse of a Gaussian (red). Both "
        "axes, and the three panels of a row, have one scale.",
    )


def _json(kinds: Kinds) -> dict[str, Any]:
    named = {"convergent": kinds.convergent, "divergent": kinds.divergent, "largest_dip": kinds.modal}
    pushes = [
        {
            "fraction": cell.fraction,
            "angle": cell.angle,
            "repetitions": len(paths),
            "way": float(travel(paths[:, -1])),
            "spread": float(final_spread(paths)),
            "relative_spread": float(relative_spread(paths)),
            "growth": float(growth(paths)),
            "dip_family_wise_p": p.tolist(),
        }
        for cell, paths, p in zip(kinds.cells, kinds.paths, kinds.p, strict=True)
    ]
    return {"chosen": {name: pushes[k] for name, k in named.items()}, "pushes": pushes}
