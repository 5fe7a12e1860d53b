# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Is the shape of the noise the same on different surfaces?"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from push_predictor_paper.claims.maps.peaks import agreed
from push_predictor_paper.claims.noise.size import WIDE
from push_predictor_paper.section import Finding, Table, Verdict
from push_predictor_paper.statistics.grid_maps import BLOCK, in_degrees
from push_predictor_paper.statistics.noise_shapes import Shape, ceiling
from push_predictor_paper.study import Study

ALIKE, UNLIKE = 0.7, 0.3  # correlation of log sd
OUTPUT_NAMES = ("dx", "dy", "rotation")
CLAIM = "The shape of the noise is the same on different surfaces"


def shape_finding(
    found: Sequence[Shape], near: Sequence[Shape], most: Shape | None, learned: Sequence[Shape]
) -> Finding:
    """Is the shape the same for all pairs of surfaces? near: only pushes at moderate angles."""
    if not found or most is None:
        return Finding(CLAIM, "not decided", "Fewer than two surfaces have repetitions of the same pushes.")
    verdict = agreed(_verdict(found), _verdict(learned))
    halves = ", ".join(f"{name} {e.text()}" for name, e in zip(OUTPUT_NAMES, most.pearson, strict=True))
    return Finding(
        CLAIM,
        verdict,
        f"Correlation of log sd over the pushes, for {len(found)} pairs of surfaces. By repetitions: "
        f"{_ranges(found)}; within {in_degrees(WIDE)}: {_ranges(near)}. Two halves of one surface's repetitions "
        f"reach {halves}. By the VHGPs' process noise, of which the paper speaks: {_ranges(learned)}. Rule, over all "
        f"pushes: holds if the intervals of all pairs and outputs lie above {ALIKE:g}; in part if some lie above "
        f"{UNLIKE:g}; does not hold if all lie below {UNLIKE:g}. In part also if it holds, or holds in part, only by "
        "repetitions or only by VHGPs. The simulator's surfaces share one mechanism of noise, so this holds partly "
        "by construction.",
        number=f"correlation {_ranges(found)}",
    )


def _verdict(found: Sequence[Shape]) -> Verdict:
    if not found:
        return "not decided"
    low, high = (np.array([[getattr(e, end) for e in pair.pearson] for pair in found]) for end in ("low", "high"))
    if np.all(low > ALIKE):
        return "holds"
    if np.all(high < UNLIKE):
        return "does not hold"
    return "holds in part" if np.any(low > UNLIKE) else "not decided"


def shape_tables(
    study: Study, found: Sequence[Shape], near: Sequence[Shape], most: Shape | None, learned: Sequence[Shape]
) -> tuple[Table, ...]:
    """Correlations by repetitions, by repetitions at moderate angles, and by the VHGPs."""
    block = f"Intervals resample blocks of neighbouring pushes ({BLOCK[0]:g} of the side × {in_degrees(BLOCK[1])})."
    halved = "Halves of one surface's repetitions: the largest correlation that so few repetitions can show."
    nearest = ceiling(study.reference_grid, WIDE)
    size = f"{study.plan.size} training windows or all"
    return tuple(
        _table(f"{caption} {block}", rows)
        for caption, rows in (
            (
                f"Correlation of log sd between surfaces, simulated repetitions, all pushes. {halved}",
                _with(found, most),
            ),
            (
                f"The same for pushes within {in_degrees(WIDE)}, without those that hardly move the slider.",
                _with(near, nearest),
            ),
            (
                f"Correlation of the log sd of the VHGPs' process noise, {size} on each surface, the first of "
                f"{study.plan.seeds} draws of these; simulated.",
                list(learned),
            ),
        )
        if rows
    )


def shape_json(found: Sequence[Shape], most: Shape | None, learned: Sequence[Shape]) -> dict[str, Any]:
    """By pair."""
    named = {"repetitions": list(found), "halves": [] if most is None else [most], "vhgp": list(learned)}
    return {
        name: {
            f"{one.first}/{one.second}": {
                "pushes": one.pushes,
                "pearson": [e.json() for e in one.pearson],
                "spearman": [e.json() for e in one.spearman],
            }
            for one in parts
        }
        for name, parts in named.items()
    }


def _ranges(found: Sequence[Shape]) -> str:
    """Range of each output's correlations over the pairs, and the lowest end of their intervals."""
    if not found:
        return "too few"
    parts = []
    for k, name in enumerate(OUTPUT_NAMES):
        values = sorted(pair.pearson[k].value for pair in found)
        span = " to ".join(dict.fromkeys(f"{v:.2f}" for v in (values[0], values[-1])))
        parts.append(f"{name} {span} (lowest end {min(pair.pearson[k].low for pair in found):.2f})")
    return ", ".join(parts).replace("-", "−")


def _with(found: Sequence[Shape], most: Shape | None) -> list[Shape]:
    return list(found) if most is None else [*found, most]


def _table(caption: str, rows: Sequence[Shape]) -> Table:
    head = ("surfaces", "pushes", *(f"{name}, {r}" for r in ("Pearson", "Spearman") for name in OUTPUT_NAMES))
    return Table(
        caption,
        head,
        tuple((f"{r.first}, {r.second}", str(r.pushes), *(e.cell() for e in (*r.pearson, *r.spearman))) for r in rows),
    )
