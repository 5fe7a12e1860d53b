# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The size of the noise, its range over pushes, and its shape on different surfaces."""

from __future__ import annotations

from collections.abc import Sequence

from push_predictor.reporting.canvas import SYMBOLS, Picture, draw
from push_predictor_paper.claims.noise.learned import learned_parts
from push_predictor_paper.claims.noise.shape import shape_finding, shape_json, shape_tables
from push_predictor_paper.claims.noise.size import (
    NAMES,
    WIDE,
    ratio_json,
    size_finding,
    size_table,
    span_finding,
    span_json,
    span_table,
)
from push_predictor_paper.figures.noise_maps import paint_noise_maps, paint_ratios, paint_scatter
from push_predictor_paper.fits.map_models import surface_maps
from push_predictor_paper.section import Finding, Section
from push_predictor_paper.statistics.grid_maps import in_degrees
from push_predictor_paper.statistics.noise_figures import Ratios, noise_ratios, radius_of_gyration, spans
from push_predictor_paper.statistics.noise_shapes import FEWEST_PUSHES, ceiling, learned_shapes, shapes
from push_predictor_paper.study import Study

TITLE = "Size, range and shape of the noise"


def section(study: Study) -> Section:
    """The noise of repetitions on every surface, of VHGPs, and of VHGPs of measured sets."""
    grid = study.reference_grid
    near = [cell for cell in grid.seen if abs(cell.angle) <= WIDE]
    if len(near) < FEWEST_PUSHES:
        few = (
            f"Only {len(near)} pushes within {in_degrees(WIDE)} have enough repetitions; {FEWEST_PUSHES} are required."
        )
        return Section("noise", TITLE, (Finding("The noise depends on the push", "not decided", few),))
    arm = radius_of_gyration(grid)
    ratios = {"all": noise_ratios(grid.seen, arm), "near": noise_ratios(near, arm)}
    reach = {"all": spans(grid.seen), "near": spans(near)}
    counts = {"all": len(grid.seen), "near": len(near)}
    found, found_near, most = shapes(study.grids), shapes(study.grids, WIDE), ceiling(grid)
    learned = learned_shapes(study.grids, surface_maps(study, "vhgp"))
    tables, notes, data = learned_parts(study)
    return Section(
        key="noise",
        title=TITLE,
        findings=(
            size_finding(ratios["all"], grid),
            span_finding(reach, counts),
            shape_finding(found, found_near, most, learned),
        ),
        tables=(
            size_table(ratios, counts, grid, arm),
            span_table(reach, counts, grid),
            *shape_tables(study, found, found_near, most, learned),
            *tables,
        ),
        pictures=(_ratio_picture(study, ratios["all"]), *_map_pictures(study)),
        notes=(*NOTES, *notes),
        data={
            "ratio": {which: ratio_json(parts) for which, parts in ratios.items()},
            "span": {which: span_json(parts) for which, parts in reach.items()},
            "shape": shape_json(found, most, learned),
            "learnt": data,
        },
    )


NOTES = (
    "All surfaces of the simulator share one mechanism of noise and one slider; they differ in its parameters. "
    "Contact and support vary along a push and from push to push, and the trackers add noise. That the noise has "
    "the same shape on all surfaces therefore holds partly by construction and proves nothing about real surfaces.",
    "The size of the noise follows from strengths that we chose. Only where it is large and where small follows from "
    "the mechanics.",
    "Repetitions are at one speed, 20 mm/s. The paper's order of magnitude is also over speeds.",
    "|mean| of dy and of the rotation passes through zero between pushes, where the ratio has no meaning. The tables "
    "therefore show quantiles, root mean squares, and the whole motion (rotation times the radius of gyration).",
)


def _ratio_picture(study: Study, ratios: Sequence[Ratios]) -> Picture:
    names = (*SYMBOLS, NAMES[-1])
    parts = [(name, part.values) for name, part in zip(names, ratios, strict=True)]
    path = draw(study.out / "noise_ratio.png", (7.5, 3.4), lambda figure: paint_ratios(figure, parts))
    return Picture(
        path,
        "Cumulative share of the pushes against the sd as a percentage of the mean, for each output",
        f"Cumulative share of {len(ratios[0].values)} pushes on {study.reference_grid.surface} (simulated repetitions) "
        "by their noise as a percentage of the mean. Shaded: the paper's 10 to 40 %.",
    )


def _map_pictures(study: Study) -> list[Picture]:
    grids, reference = {s: g for s, g in study.grids.items() if g.seen}, study.reference_grid
    height = 1.7 * len(grids) + 1.2
    again = ", ".join(f"{surface} {g.cells[0].commanded}" for surface, g in grids.items())
    maps = Picture(
        draw(study.out / "noise_maps.png", (9.0, height), lambda figure: paint_noise_maps(figure, grids)),
        "Maps of the standard deviation of dx, dy and rotation over contact and angle, a row for each surface",
        "Sd of the first window by contact and angle, divided by the median of its surface. Simulated repetitions "
        f"of each push: {again}. One scale per column.",
    )
    others = {surface: g for surface, g in grids.items() if g is not reference}
    if not others:
        return [maps]
    scatter = Picture(
        draw(study.out / "noise_scatter.png", (9.0, 3.7), lambda figure: paint_scatter(figure, reference, others)),
        "The sd of every push on one surface against that on the others, for each output",
        f"Each mark is a push: its sd on {reference.surface} and on another surface, each divided by the median of its "
        "surface. Simulated repetitions. On the line the shape is the same.",
    )
    return [maps, scatter]
