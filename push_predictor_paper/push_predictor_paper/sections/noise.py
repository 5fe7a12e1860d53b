# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The size of the noise, its range over pushes, and its shape on different surfaces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.report.maps import ColourScale
from push_predictor.reporting.canvas import SYMBOLS, Picture
from push_predictor.types import Array
from push_predictor_paper.data.repetitions import RepeatedGrid, Repetitions
from push_predictor_paper.estimate import of_ends
from push_predictor_paper.fits.map_models import ModelMap, surface_maps
from push_predictor_paper.painters.curves import LOOKS, Panel, cumulative, paint_curves
from push_predictor_paper.painters.maps import Map, paint_maps
from push_predictor_paper.section import OUTPUT_NAMES, Number, Section, Table, TooFewError, picture
from push_predictor_paper.statistics.grid_maps import (
    FEWEST_PUSHES,
    OF_BLOCKS,
    Place,
    block_weights,
    by_blocks,
    correlation,
    in_degrees,
    redrawn,
    unbiased,
)
from push_predictor_paper.study import Study
from push_predictor_paper.verdict import Bound, Evidence, Figure

WIDE = 1.0  # rad; beyond it the tip soon slides along the side
NAMES = (*OUTPUT_NAMES, "whole motion")
MOSTLY = Bound(low=0.8)  # of the pushes
LOW, HIGH = 0.1, 0.4  # of the expected output, the paper's
NOTES = (
    "All surfaces of the simulator share one mechanism of noise and one slider; they differ in its parameters. That "
    "the noise has the same shape on all surfaces therefore holds partly by construction, and its size follows from "
    "strengths that we chose. Only where it is large and where small follows from the mechanics.",
    "Repetitions are at one speed, 20 mm/s. The paper's order of magnitude is also over speeds.",
    "|mean| of dy and of the rotation passes through zero between pushes, where the ratio has no meaning. The table "
    "therefore shows root mean squares, and the whole motion (rotation times the radius of gyration). "
    f"Beyond {in_degrees(WIDE)} the slider hardly moves, so the noise is small there.",
)


@dataclass(frozen=True, eq=False)
class Ratios:
    """sd over |mean| of m pushes, of one output or of the whole motion.

    values (m,); within: share of the pushes between 10 and 40 %; overall: root mean square of the sd over that of the
    mean.
    """

    values: Array
    within: Estimate
    overall: Estimate


@dataclass(frozen=True)
class Shape:
    """Correlations of log sd by output between two surfaces, or two halves of one surface's repetitions."""

    first: str
    second: str
    pushes: int
    correlations: tuple[Estimate, ...]


def section(study: Study) -> Section:
    """The noise of repetitions on every surface, and of VHGPs."""
    grid = study.reference_grid
    groups = {
        f"all {len(grid.seen)} pushes": grid.seen,
        f"within {in_degrees(WIDE)}": [cell for cell in grid.seen if abs(cell.angle) <= WIDE],
    }
    if any(len(cells) < FEWEST_PUSHES for cells in groups.values()):
        raise TooFewError(f"Fewer than {FEWEST_PUSHES} pushes within {in_degrees(WIDE)} have enough repetitions.")
    arm = float(np.sqrt(grid.rig.outline.polar_moment))  # radius of gyration
    ratios = {name: noise_ratios(cells, arm) for name, cells in groups.items()}
    ranges = {name: spans(cells) for name, cells in groups.items()}
    found = {
        "repetitions": repeated_shapes(study.grids),
        "VHGP": learned_shapes(study.grids, surface_maps(study, "vhgp")),
    }
    most = ceiling(grid)
    every = next(iter(ratios.values()))
    return Section(
        {"size": size(every), "span": span(ranges), "shape": shape(found, most)},
        (
            _size_table(grid, ratios, ranges, arm),
            _shape_table(study, {**found, "halves of the repetitions": [most] if most else []}),
        ),
        (_ratio_picture(study, every), _map_picture(study)),
        NOTES,
    )


def size(ratios: Sequence[Ratios]) -> Evidence:
    """Is the noise 10 to 40 % of the mean outcome? ratios: dx, dy, rotation, whole motion of all pushes."""
    figures = [Figure(name, part.overall) for name, part in zip(OUTPUT_NAMES, ratios[:3], strict=True)]
    return Evidence([*figures, Figure("share of pushes", ratios[3].within, MOSTLY)])


def span(ranges: Mapping[str, Sequence[Estimate]]) -> Evidence:
    """Does the noise vary by an order of magnitude? ranges: of all pushes, and of those at moderate angles."""
    return Evidence([Figure(name, of_ends(np.max, parts)) for name, parts in ranges.items()])


def shape(found: Mapping[str, Sequence[Shape]], most: Shape | None) -> Evidence:
    """Is the shape the same for all pairs of surfaces, by repetitions and by the process noise of the VHGPs?"""
    figures = [
        Figure(f"{name}, {source}", of_ends(np.min, [pair.correlations[k] for pair in pairs]))
        for source, pairs in found.items()
        for k, name in enumerate(OUTPUT_NAMES if pairs else ())
    ]
    halves = (
        ", ".join(f"{n} {e.text()}" for n, e in zip(OUTPUT_NAMES, most.correlations, strict=True))
        if most
        else "unknown"
    )
    return Evidence(figures, f"Two halves of one surface's repetitions reach: {halves}.")


def noise_ratios(cells: list[Repetitions], arm: float) -> tuple[Ratios, ...]:
    """Ratios of dx, dy, dtheta and the whole motion; rotations count as the arc (m) at radius `arm` (m)."""
    mean, sd = np.array([cell.mean for cell in cells]), np.array([cell.sd for cell in cells])
    weights, metres = block_weights(cells), np.array([1.0, 1.0, arm])
    whole = [np.sqrt(np.sum((part * metres) ** 2, axis=1)) for part in (mean, sd)]
    parts = [(np.abs(mean[:, k]), sd[:, k]) for k in range(3)]
    return tuple(_ratios(m, s, weights) for m, s in (*parts, (whole[0], whole[1])))


def _ratios(mean: Array, sd: Array, weights: Array) -> Ratios:
    values = sd / mean
    inside = ((values >= LOW) & (values <= HIGH)).astype(np.float64)
    return Ratios(
        values,
        by_blocks(lambda w: w @ inside / w.sum(axis=1), weights),
        by_blocks(lambda w: np.sqrt((w @ sd**2) / (w @ mean**2)), weights),
    )


def spans(cells: list[Repetitions]) -> tuple[Estimate, ...]:
    """95th over 5th percentile of the sds of dx, dy, dtheta over pushes; intervals resample repetitions, not pushes."""
    sd, drawn = np.array([cell.sd for cell in cells]), redrawn(cells)[1]
    logs = [unbiased(float(np.log(span_of(sd[:, k]))), np.log(_span(drawn[..., k]))) for k in range(3)]
    return tuple(Estimate(*np.exp([log.value, log.low, log.high]).tolist()) for log in logs)


def span_of(values: Array) -> float:
    """95th over 5th percentile of sds (m,)."""
    return float(_span(values[None])[0])


def _span(sd: Array) -> Array:
    low, high = np.quantile(sd, [0.05, 0.95], axis=1)
    return np.asarray(high / low)


def repeated_shapes(grids: Mapping[str, RepeatedGrid]) -> list[Shape]:
    """Correlations for all pairs of surfaces, over pushes known on both."""
    return _pairs({s: {_place(cell): cell.sd for cell in grid.seen} for s, grid in grids.items()}, grids)


def ceiling(grid: RepeatedGrid) -> Shape | None:
    """Correlation between two halves of one surface's repetitions: the largest that is possible."""
    cells = grid.seen
    if len(cells) < FEWEST_PUSHES:
        return None
    halves = [np.array([cell.outcomes[start::2].std(axis=0, ddof=1) for cell in cells]) for start in (0, 1)]
    return _shape((f"{grid.surface}, odd", "even repetitions"), cells, halves[0], halves[1])


def learned_shapes(grids: Mapping[str, RepeatedGrid], models: Mapping[str, ModelMap]) -> list[Shape]:
    """Correlations of the process noise of the surfaces' models, at pushes known on both."""
    answers = {surface: model.at_pushes.process_sd for surface, model in models.items() if model.at_pushes is not None}
    return _pairs({s: dict(zip(map(_place, grids[s].seen), sds, strict=True)) for s, sds in answers.items()}, grids)


def _pairs(sds: Mapping[str, Mapping[Place, Array]], grids: Mapping[str, RepeatedGrid]) -> list[Shape]:
    """Correlations of sds (3,) by surface and place, for all pairs of surfaces with enough common places."""
    found = []
    for a, b in combinations(sds, 2):
        cells = [cell for cell in grids[a].seen if _place(cell) in sds[a] and _place(cell) in sds[b]]
        if len(cells) >= FEWEST_PUSHES:
            one, other = (np.array([sds[surface][_place(cell)] for cell in cells]) for surface in (a, b))
            found.append(_shape((a, b), cells, one, other))
    return found


def _shape(names: tuple[str, str], cells: list[Repetitions], one: Array, other: Array) -> Shape:
    weights, logs = block_weights(cells), (np.log(one), np.log(other))
    return Shape(
        *names,
        len(cells),
        tuple(by_blocks(partial(correlation, logs[0][:, k], logs[1][:, k]), weights) for k in range(3)),
    )


def _place(cell: Repetitions) -> Place:
    return cell.fraction, cell.angle


def _size_table(
    grid: RepeatedGrid, ratios: Mapping[str, Sequence[Ratios]], ranges: Mapping[str, Sequence[Estimate]], arm: float
) -> Table:
    """Share within the paper's range, ratio of root mean squares, range of the sd; arm in m."""
    rows = [
        (
            f"{name}, {which}",
            Number(part.within, ".0%"),
            Number(part.overall, ".0%"),
            Number(reach, ".1f") if reach else "–",
        )
        for which, parts in ratios.items()
        for name, part, reach in zip(NAMES, parts, (*ranges[which], None), strict=True)
    ]
    head = ("sd over |mean|", "within 10 to 40 %", "RMS ratio", "95th over 5th percentile of the sd")
    caption = (
        f"The noise relative to the mean outcome. Simulated repetitions on {grid.surface}, first window of 0.2 s at "
        f"20 mm/s. Whole motion: rotation times {arm * 1e3:.1f} mm, the square's radius of gyration. RMS ratio: root "
        f"mean square of the sd over that of the mean. {OF_BLOCKS} Last: the range of the sd; its intervals resample "
        "repetitions, and a basic bootstrap of the logarithm removes most of the bias from errors of the sds."
    )
    return Table(caption, head, rows)


def _shape_table(study: Study, found: Mapping[str, Sequence[Shape]]) -> Table:
    """Correlations by repetitions, and by the VHGPs."""
    rows = [
        (f"{source}: {pair.first}, {pair.second}", pair.pushes, *map(Number, pair.correlations))
        for source, pairs in found.items()
        for pair in pairs
    ]
    caption = (
        "Correlation of log sd between surfaces, by repetitions and by the VHGPs' process noise. Simulated; VHGPs of "
        f"{study.plan.size} training windows or all on each surface. Halves of one surface's repetitions: the largest "
        f"correlation that so few repetitions can show. {OF_BLOCKS}"
    )
    return Table(caption, ("surfaces", "pushes", *OUTPUT_NAMES), rows)


def _ratio_picture(study: Study, ratios: Sequence[Ratios]) -> Picture:
    names = (*SYMBOLS, NAMES[-1])
    lines = [cumulative(n, look, 100.0 * part.values) for n, look, part in zip(names, LOOKS, ratios, strict=True)]
    panel = Panel(
        "",
        "sd of the outcome, % of its |mean|",
        "cumulative share of pushes (%)",
        lines,
        (1, 3, 10, 30, 100, 300, 1000),
        shaded=(100 * LOW, 100 * HIGH),
        limits=(0.0, 100.0),
    )
    return picture(
        study.out / "noise_ratio.png",
        (7.0, 3.6),
        partial(paint_curves, rows=[[panel]]),
        "Cumulative share of the pushes against the sd as a percentage of the mean, for each output. "
        f"{len(ratios[0].values)} pushes on {study.reference_grid.surface}, simulated repetitions. Shaded: the "
        "paper's 10 to 40 %.",
    )


def _map_picture(study: Study) -> Picture:
    """A row per surface, a column per output: sd over the surface's median, one scale per column."""
    grids = {surface: grid for surface, grid in study.grids.items() if grid.seen}
    shown = {surface: grid.sd / np.nanmedian(grid.sd, axis=(0, 1)) for surface, grid in grids.items()}
    tops = [float(np.nanpercentile([sd[..., k] for sd in shown.values()], 99.0)) for k in range(3)]
    rows = [
        (
            surface,
            [
                Map(
                    f"sd of {SYMBOLS[k]}",
                    grid.fractions,
                    grid.angles,
                    shown[surface][..., k],
                    ColourScale(0.0, tops[k], "viridis", "max"),
                    "sd / median",
                )
                for k in range(3)
            ],
        )
        for surface, grid in grids.items()
    ]
    return picture(
        study.out / "noise_maps.png",
        (10.0, 1.9 * len(grids) + 0.8),
        partial(paint_maps, rows=rows),
        "Maps of the standard deviation of dx, dy and rotation over contact and angle, a row for each surface. "
        "Simulated repetitions, first window; divided by the median of the surface. One scale per column.",
    )
