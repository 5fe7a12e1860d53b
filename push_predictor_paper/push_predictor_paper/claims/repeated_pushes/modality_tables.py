# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of modes, and of the loss of a Gaussian."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from push_predictor.types import Array
from push_predictor_paper.claims.repeated_pushes.modality_rules import LEVEL, POWER, mean_over_pushes
from push_predictor_paper.data.repetitions import RepeatedGrid, Repetitions
from push_predictor_paper.section import Table
from push_predictor_paper.statistics.densities import Shape
from push_predictor_paper.statistics.grid_maps import place_text

SEPARATIONS = (3.0, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0, 7.0, 8.0, 10.0)
LISTED = 10
OUTPUT_NAMES = ("dx", "dy", "rotation")
WHEN = {"window": "first 0.2 s", "end": "end of the 1 cm push"}

Powers = Mapping[float, tuple[float, float]]  # by separation: found family-wise, found by a single test


def counts_table(grid: RepeatedGrid, at: Mapping[str, Shape], weights: Array) -> Table:
    """Numbers of pushes with several modes, and of pushes that are not Gaussian."""
    rows = []
    for when, of in at.items():
        for k, name in enumerate(OUTPUT_NAMES):
            counts = (np.sum(p <= LEVEL) for p in (of.several[:, k], of.dip[:, k], of.normal[:, k]))
            gain = mean_over_pushes((of.two - of.one)[:, k : k + 1], weights).cell("+.3f")
            rows.append((f"{WHEN[when]}: {name}", *map(str, counts), f"{LEVEL * len(of.dip):.0f}", gain))
    head = (
        "outcome",
        "several modes, 5 % family-wise",
        "dip, single tests at 5 %",
        "Gaussian rejected, single tests at 5 %",
    )
    caption = (
        f"Numbers of pushes with more than one mode, of {len(grid.seen)} simulated pushes of the grid on "
        f"{grid.surface}, about {repetitions_of(grid)} repetitions each. Family-wise: the probability of one or more "
        "false ones is at most 5 %. Last: log density of held-out fifths of the repetitions, two Gaussians minus "
        "one. Beneath: 95 % interval from resampling blocks of neighbouring pushes; single outliers weigh heavily "
        "in it."
    )
    return Table(caption, (*head, "single rejections by chance", "two Gaussians over one (nats)"), tuple(rows))


def power_table(grid: RepeatedGrid, powers: Powers) -> Table:
    """The power of the test."""
    rows = tuple((f"{s:.1f}", f"{corrected:.0%}", f"{single:.0%}") for s, (corrected, single) in powers.items())
    enough = [s for s, (corrected, _) in powers.items() if corrected >= POWER]
    least = f"from {enough[0]:.1f} sd on" if enough else f"only beyond {SEPARATIONS[-1]:.0f} sd"
    caption = (
        f"The power of the test at {repetitions_of(grid)} repetitions: two equal Gaussian modes, their distance in "
        f"units of the sd of each (below 2 their sum has one mode), by 1000 draws, ±3 % at most. {POWER:.0%} are "
        f"found {least}; the test may miss nearer modes."
    )
    return Table(caption, ("distance of the modes (sd)", "found, 5 % family-wise", "found by one test at 5 %"), rows)


def listed_table(grid: RepeatedGrid, of: Shape, loss: Array) -> Table:
    """The pushes with the largest dips."""
    rows = []
    for place in np.argsort(of.dip, axis=None)[: max(LISTED, int(np.sum(of.several <= LEVEL)))]:
        push, k = divmod(int(place), 3)
        nats = (f"{v:+.2f}".replace("-", "−") for v in (of.two[push, k] - of.one[push, k], loss[push, k]))
        tests = (f"{p[push, k]:.2g}" for p in (of.dip, of.several, of.normal))
        rows.append(
            (f"{place_of(grid.seen[push])}: {OUTPUT_NAMES[k]}", str(len(grid.seen[push].outcomes)), *tests, *nats)
        )
    head = ("push", "repetitions", "p of the dip", "p family-wise", "p of a Gaussian", "two Gaussians over one (nats)")
    caption = (
        "The outcomes of the first window with the largest dips, and all with several modes. Simulated. Last: the "
        "loss of the VHGP's Gaussian against the push's own fit. Single pushes, without interval."
    )
    return Table(caption, (*head, "lost by the VHGP (nats)"), tuple(rows))


def repetitions_of(grid: RepeatedGrid) -> int:
    """The median number of repetitions of a push of the grid."""
    return int(np.median([len(cell.outcomes) for cell in grid.seen]))


def place_of(cell: Repetitions) -> str:
    """Contact and angle, in words."""
    return place_text((cell.fraction, cell.angle))
