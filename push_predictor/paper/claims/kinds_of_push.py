"""Three kinds of repeated push: convergent, divergent, multi-modal, each chosen by a rule and judged by numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from push_predictor.evaluation.figures.canvas import Picture, draw
from push_predictor.paper.claims.kinds_of_push_rules import (
    APART,
    FAR,
    LEAST_TRAVEL,
    LEVEL,
    POWER,
    Figure,
    Kinds,
    apart,
    draws_together_fans_out,
    growth,
    has_modes,
    kinds_of,
    relative_spread,
    resampled,
    spread,
    travel,
)
from push_predictor.paper.densities import found_at
from push_predictor.paper.estimate import of_draws
from push_predictor.paper.figures.trajectories import Trajectories, paint_trajectories
from push_predictor.paper.plan import GRID_SPEED
from push_predictor.paper.repetitions import RepeatedGrid, Repetitions
from push_predictor.paper.section import Finding, Section, Table
from push_predictor.paper.study import Study
from push_predictor.types import Array


def section(study: Study) -> Section:
    """The three pushes with their trajectories, and whether they are what they are called."""
    grid = study.reference_grid
    kinds = kinds_of(grid)
    notes = NOTES if not study.measured else (*NOTES, "The measured sets hold no grid of repeated pushes.")
    if kinds is None:
        note = f"Fewer than two pushes of the grid moved the slider by {1e3 * LEAST_TRAVEL:.0f} mm often enough."
        return Section("kinds_of_push", TITLE, (Finding(CLAIM_KINDS, "not decided", note),), notes=(note, *notes))
    return Section(
        key="kinds_of_push",
        title=TITLE,
        findings=(_kinds_finding(kinds), _growth_finding(kinds), _modes_finding(kinds)),
        tables=(_table(grid, kinds),),
        pictures=(_picture(study, grid, kinds),),
        notes=notes,
        data=_json(kinds),
    )


TITLE = "Three kinds of push"
CLAIM_KINDS = "Some pushes, repeated, are convergent, others divergent"
CLAIM_GROWTH = "Paths of convergent pushes draw together as they go, those of divergent ones fan out"
CLAIM_MODES = "Some pushes, repeated, are multi-modal"
NOTES = (
    "Spread: root mean square distance of the slider's centre from its mean. Relative spread: spread at the end over "
    "the mean displacement. Paths are relative to where the slider was at the first touch, so all begin together: "
    "what is seen is how they part, not whether differences at the start vanish.",
    f"Only pushes that move the slider by {1e3 * LEAST_TRAVEL:.0f} mm or more: below, the tip grazes. Convergent: "
    "least relative spread; divergent: largest; chosen by every second repetition, judged by the others: the extremes "
    "of many noisy figures would else look more extreme than they are. Multi-modal: least p of the dip test on the "
    "final poses (x, y or heading), family-wise by Holm's correction over all pushes and the three of them.",
    "Repetitions in which the slider moves further within 20 ms than the tip could push it are left out: there the "
    "path runs into the reset that follows a push whose first touch came late.",
    "Why simulated repetitions part is a property of our simulator (friction and pressure that vary over table and "
    "slider) and proves nothing about the world. The paper shows its three pushes by eye, without numbers.",
)


def _kinds_finding(kinds: Kinds) -> Finding:
    narrow, narrow_draws = resampled(kinds.paths[kinds.convergent][1::2], relative_spread, 0)
    wide, wide_draws = resampled(kinds.paths[kinds.divergent][1::2], relative_spread, 1)
    ratio = of_draws(wide / narrow, wide_draws / narrow_draws)
    middle = np.quantile([relative_spread(paths) for paths in kinds.paths], [0.1, 0.5, 0.9])
    return Finding(
        CLAIM_KINDS,
        apart(ratio),
        f"The divergent push ends {ratio.text('.1f')} times as far apart, relative to its way, as the convergent one: "
        f"{wide:.0%} and {narrow:.0%} of it ({_counts(kinds)} repetitions that did not choose them, drawn anew for the "
        f"interval). Of all {len(kinds.paths)} pushes a tenth lie below {middle[0]:.0%}, half below "
        f"{middle[1]:.0%}, a tenth above {middle[2]:.0%}. Holds if the interval lies above {APART:.0f}, in part if "
        f"above 1, does not hold if it ends below {APART:.0f} and reaches 1.",
    )


def _growth_finding(kinds: Kinds) -> Finding:
    narrow, wide = (of_draws(*resampled(kinds.paths[k][1::2], growth)) for k in (kinds.convergent, kinds.divergent))
    return Finding(
        CLAIM_GROWTH,
        draws_together_fans_out(narrow, wide),
        f"Relative spread at the end over that half-way: convergent {narrow.text()}, divergent {wide.text()} (1: "
        f"straight rays; below: drawn together; above: fanned out); {_counts(kinds)} repetitions that did not choose "
        "them (divergent, convergent). Holds if the first lies below 1 and the second above, in part if one does, "
        "does not hold if neither and one lies on the other side.",
    )


def _modes_finding(kinds: Kinds) -> Finding:
    least, repetitions = float(kinds.p.min()), int(np.median([len(p) for p in kinds.paths]))
    power, _ = found_at(FAR, repetitions, kinds.p.size, LEVEL)
    count = int((kinds.p <= LEVEL).any(axis=1).sum())
    return Finding(
        CLAIM_MODES,
        has_modes(least, power),
        f"{count} of {len(kinds.p)} pushes that move the slider have final poses with more than one mode, 5 % "
        f"family-wise. The push shown is that with the least p of the dip test, {least:.2g} after correction for "
        f"choosing it among all. Two equal modes {FAR:.0f} of their sd apart would be found in {power:.0%} of cases at "
        f"{repetitions} repetitions. Holds if that p is at most {LEVEL}; does not hold if not, though such modes are "
        f"found in {POWER:.0%}.",
    )


def _counts(kinds: Kinds) -> str:
    return " and ".join(str(len(kinds.paths[k][1::2])) for k in (kinds.divergent, kinds.convergent))


def _table(grid: RepeatedGrid, kinds: Kinds) -> Table:
    rows = tuple(_row(kinds, name, k, half) for name, k, half in _three(kinds))
    broken = sum(len(c.paths) - len(p) for c, p in zip(kinds.cells, kinds.paths, strict=True))
    caption = (
        f"Simulated: the three pushes of the grid on {grid.surface}, 1 cm at {1e3 * GRID_SPEED:.0f} mm/s, chosen among "
        f"the {len(kinds.cells)} that move the slider. Intervals draw repetitions anew; for the first two, of the half "
        "that did not choose them. "
        f"{broken} of {sum(len(c.paths) for c in kinds.cells)} repetitions left out, see below."
    )
    head = ("push", "contact, angle", "repetitions", "way (mm)", "spread half-way (mm)", "spread at the end (mm)")
    return Table(caption, (*head, "relative spread (%)", "growth", "p of the dip, family-wise"), rows)


def _row(kinds: Kinds, name: str, k: int, paths: Array) -> tuple[str, ...]:
    cells = (of_draws(*resampled(paths, figure)).cell(form) for figure, form in COLUMNS)
    return (name, _where(kinds.cells[k]), str(len(paths)), *cells, f"{kinds.p[k].min():.2g}")


COLUMNS: tuple[tuple[Figure, str], ...] = (
    (lambda paths: 1e3 * travel(paths[:, -1]), ".2f"),
    (lambda paths: 1e3 * spread(paths[:, paths.shape[1] // 2, :2]), ".2f"),
    (lambda paths: 1e3 * spread(paths[:, -1, :2]), ".2f"),
    (lambda paths: 100.0 * relative_spread(paths), ".1f"),
    (growth, ".2f"),
)


def _three(kinds: Kinds) -> tuple[tuple[str, int, Array], ...]:
    """Name, place and repetitions to judge by."""
    return (
        ("convergent", kinds.convergent, kinds.paths[kinds.convergent][1::2]),
        ("divergent", kinds.divergent, kinds.paths[kinds.divergent][1::2]),
        ("largest dip", kinds.modal, kinds.paths[kinds.modal]),
    )


def _where(cell: Repetitions) -> str:
    return f"{cell.fraction:.2f}, {cell.angle:+.1f} rad".replace("-", "−")


def _picture(study: Study, grid: RepeatedGrid, kinds: Kinds) -> Picture:
    shown = [
        Trajectories(f"{name}: contact {_where(kinds.cells[k])}", kinds.cells[k].inputs.mean(axis=0), kinds.paths[k])
        for name, k, _ in _three(kinds)
    ]
    path = draw(
        study.out / "kinds_of_push.png", (10.0, 6.6), lambda figure: paint_trajectories(figure, grid.rig, shown)
    )
    counts = ", ".join(str(len(one.paths)) for one in shown)
    return Picture(
        path,
        "Trajectories of a convergent push, a divergent one, and the one with the largest dip",
        f"Simulated, {grid.shape} on {grid.surface}: all repetitions ({counts}) of three pushes of 1 cm at "
        f"{1e3 * GRID_SPEED:.0f} mm/s; contact as a fraction of the side, angle from its normal. Above: slider at the "
        "start, tip and its way (grey), trajectories of the slider's centre (green). Below: the same trajectories, "
        "enlarged; the red ellipse holds 95 % of the final poses (dots) if they are Gaussian. x and y "
        "have the same scale; every panel below has its own.",
    )


def _json(kinds: Kinds) -> dict[str, Any]:
    named = {"convergent": kinds.convergent, "divergent": kinds.divergent, "largest_dip": kinds.modal}
    pushes = [
        {
            "fraction": cell.fraction,
            "angle": cell.angle,
            "repetitions": len(paths),
            "way": travel(paths[:, -1]),
            "spread": spread(paths[:, -1, :2]),
            "growth": growth(paths),
            "dip_family_wise_p": p.tolist(),
        }
        for cell, paths, p in zip(kinds.cells, kinds.paths, kinds.p, strict=True)
    ]
    return {"chosen": {name: pushes[k] for name, k in named.items()}, "pushes": pushes}
