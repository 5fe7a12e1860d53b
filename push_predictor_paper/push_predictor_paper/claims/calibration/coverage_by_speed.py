# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Coverage of slow, medium and fast pushes: can one noise level fit all speeds?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from push_predictor.recordings.table import OUTPUTS
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.section import Finding, Table, Verdict
from push_predictor_paper.statistics.pit import Pits, coverage

LEVEL = 0.95
TOO_WIDE = 0.1
GROUPS = ("slow", "medium", "fast")


@dataclass(frozen=True)
class GroupCoverage:
    """Coverage of the 95 % intervals in a group of speeds, by model and output."""

    name: str
    span: str
    windows: int
    pushes: int
    models: Mapping[str, Sequence[Estimate]]


def coverage_by_speed(speeds: Sequence[float], gp: Pits, vhgp: Pits) -> tuple[GroupCoverage, ...]:
    """Coverage in three groups of a plan's speeds (m/s); gp and vhgp are of the same windows."""
    thirds = np.array_split(np.sort(speeds), len(GROUPS))
    bounds = [0.0, *(float(np.sqrt(a[-1] * b[0])) for a, b in pairwise(thirds)), np.inf]
    return tuple(_group(n, third, bounds[n], bounds[n + 1], gp, vhgp) for n, third in enumerate(thirds))


def speed_finding(groups: Sequence[GroupCoverage]) -> Finding:
    """Does the GP miss its coverage in some group, and the VHGP not?"""
    gp, vhgp = (missed(groups, model) for model in ("GP", "VHGP, exact"))
    return Finding(
        "One noise level cannot fit all speeds; noise that depends on the input can (simulated)",
        _verdict(groups, len(gp), len(vhgp)),
        f"Coverage of the 95 % intervals in {len(groups) * len(OUTPUTS)} cells (three groups of speeds, three "
        f"outputs). The GP misses 0.95 in {len(gp)} cells{_listed(gp)}, the VHGP with its exact predictive density in "
        f"{len(vhgp)}{_listed(vhgp)}. Mean distance from 0.95: GP {_distance(groups, 'GP'):.3f}, VHGP "
        f"{_distance(groups, 'VHGP, exact'):.3f}. {groups[0].windows} slow, {groups[1].windows} medium and "
        f"{groups[2].windows} fast windows, whole pushes held out. About 0.5 cells would miss by chance. Rule: a cell "
        "misses if the interval of its coverage does not contain 0.95. Holds if the GP misses in two cells or more and "
        "the VHGP in one at most; in part if the VHGP misses in more than one but fewer than the GP.",
        "beyond the paper",
        number=f"cells missed: GP {len(gp)}, VHGP {len(vhgp)}",
    )


def speed_table(groups: Sequence[GroupCoverage], size: int) -> Table:
    """A row per group and model."""
    rows = tuple(
        (f"{group.name}, {group.span}: {model}", *(e.cell(".3f") for e in estimates), _much(group))
        for group in groups
        for model, estimates in group.models.items()
    )
    return Table(
        f"Coverage of the 95 % intervals by speed of the push. Simulated reference set, {size} training windows, "
        "whole pushes held out, 95 % intervals by push.",
        ("speed: model", *OUTPUTS, "windows"),
        rows,
    )


def missed(groups: Sequence[GroupCoverage], model: str) -> list[str]:
    """The cells in which the interval of the coverage does not contain its level."""
    return [
        f"{group.name} {name} {estimate.text('.3f')}"
        for group in groups
        for name, estimate in zip(OUTPUTS, group.models[model], strict=True)
        if estimate.low > LEVEL or estimate.high < LEVEL
    ]


def _distance(groups: Sequence[GroupCoverage], model: str) -> float:
    """Mean distance of the coverage from its level over the cells."""
    return float(np.nanmean([abs(estimate.value - LEVEL) for group in groups for estimate in group.models[model]]))


def _verdict(groups: Sequence[GroupCoverage], gp: int, vhgp: int) -> Verdict:
    """Verdict by the numbers of missed cells; not decided if the GP's intervals are too wide to show a miss."""
    if gp >= 2 and vhgp < gp:
        return "holds" if vhgp <= 1 else "holds in part"
    widths = [e.high - e.low for group in groups for e in group.models["GP"]]
    return "does not hold" if gp >= 2 or np.max(widths) <= TOO_WIDE else "not decided"


def _group(number: int, speeds: np.ndarray, low: float, high: float, gp: Pits, vhgp: Pits) -> GroupCoverage:
    rows = (gp.speed > low) & (gp.speed <= high)
    push = gp.push_id[rows]
    return GroupCoverage(
        GROUPS[number],
        _span(speeds),
        int(rows.sum()),
        len(set(push.tolist())),
        {
            "GP": coverage(push, gp.exact[rows], LEVEL),
            "VHGP, Gaussian": coverage(push, vhgp.gaussian[rows], LEVEL),
            "VHGP, exact": coverage(push, vhgp.exact[rows], LEVEL),
        },
    )


def _span(speeds: np.ndarray) -> str:
    """Speeds (n,) m/s in words."""
    low, high = (f"{1e3 * speed:.0f}" for speed in (speeds[0], speeds[-1]))
    return f"{low} mm/s" if low == high else f"{low} to {high} mm/s"


def _much(group: GroupCoverage) -> str:
    return f"{group.windows}\n{group.pushes} pushes"


def _listed(cells: Sequence[str]) -> str:
    return f" ({', '.join(cells)})" if cells else ""
