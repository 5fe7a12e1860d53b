# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Check a push table: its units, and the signs of dy and dtheta.

Quasi-static mechanics decides the signs for any pressure and friction. The force of a tip whose velocity is outside the
friction cone lies between the normal and the velocity. The slider's centre follows the force: dy has the sign of minus
the angle. The slider turns as the force turns it. Inside the cone it turns as two of three lines do, the cone's edges
and the velocity (the voting theorem of Mason, 1986). Only rows in which all lines agree are judged.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.units import FASTEST, OUTRUN, rig_length
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

LONGEST = 30.0  # s of a row
CONE, NARROW = np.radians(25.0), np.radians(3.0)  # half angles of friction cones: coefficients of 0.47 and 0.05
FEWEST = 10  # rows
WRONG = -0.5  # agreement below which the sign is wrong; it is from -1 to 1, and near 1 in sound data
FRAMES = "Give dy to the left of the push, angles and contacts counter-clockwise, seen from above."


class Agreement(NamedTuple):
    """The sum of a column with the signs that mechanics expects, over that of its absolute values; rows: how many."""

    share: float
    rows: int

    @property
    def wrong(self) -> bool:
        """Whether the sign is wrong, in enough rows."""
        return self.rows >= FEWEST and self.share < WRONG


def check_table(table: PushTable, rig: Rig | None = None) -> tuple[Finding, ...]:
    """The probable mistakes of a push table, none if it is sound."""
    return tuple(table_units(table, rig) or table_signs(table, rig))


def table_units(table: PushTable, rig: Rig | None = None) -> list[Finding]:
    """Findings about the units of a table's columns."""
    velocity, path = table.inputs[:, 0], table.inputs[:, 0] * table.duration
    shift, turn = np.hypot(table.outcomes[:, 0], table.outcomes[:, 1]), np.abs(table.outcomes[:, 2])
    found = [] if rig is None else [rig_length(rig)]
    if len(table):
        found += [
            _column("velocity", "mm/s", np.median(velocity), FASTEST, "m/s"),
            _column("duration", "ms", np.median(table.duration), LONGEST, "s"),
            _column("dtheta", "degrees", np.percentile(turn, 99.0), np.pi, "rad"),
        ]
        if not any(found):
            ratio = float(np.median(shift / np.maximum(path, 1e-9)))
            found.append(_column("dx and dy", "mm", ratio, OUTRUN, "path lengths of the tip"))
    return [finding for finding in found if finding is not None]


def _column(name: str, unit: str, value: float, most: float, of: str) -> Finding | None:
    if value <= most:
        return None
    sentence = f"{name} reaches {value:.4g} {of}, more than {most:.3g}: the unit is probably {unit}."
    return Finding(
        f"units_{name.split()[0]}", "refused", sentence, "Give m, rad and s.", {name: Value(float(value), of)}
    )


def table_signs(table: PushTable, rig: Rig | None = None) -> list[Finding]:
    """Findings about the signs of dy, and with a rig of dtheta."""
    dy = _agreement(table.outcomes[:, 1], -_sign_beyond(table.inputs[:, 2], CONE))
    turn = Agreement(0.0, 0) if rig is None else _agreement(table.outcomes[:, 2], _turning(table, rig))
    if dy.wrong and turn.wrong:
        return [_finding("table_mirrored", "dy and dtheta have the wrong sign", {"dy": dy, "dtheta": turn})]
    if dy.wrong:
        return [_finding("dy_sign", "dy, or the angle, has the wrong sign", {"dy": dy})]
    if turn.wrong:
        return [_finding("dtheta_sign", "dtheta has the wrong sign, or contacts are clockwise", {"dtheta": turn})]
    return []


def _agreement(column: Array, expected: Array) -> Agreement:
    """Expected (n,): 1, -1, or 0 where mechanics does not decide."""
    judged = expected != 0.0
    size = float(np.sum(np.abs(column[judged])))
    share = float(np.sum(column[judged] * expected[judged])) / size if size > 0.0 else 0.0
    return Agreement(share, int(np.sum(judged)))


def _turning(table: PushTable, rig: Rig) -> Array:
    """The sign (n,) of the rotation where the three lines agree, else 0."""
    contact, angle = table.inputs[:, 1], table.inputs[:, 2]
    arm, normal = rig.outline.point(contact) - rig.outline.centroid, rig.outline.inward_normal(contact)
    sliding, side = np.abs(angle) > CONE, np.sign(angle)
    edges = np.where(sliding, side * NARROW, -CONE), np.where(sliding, side * CONE, CONE)
    lines = [rotate(normal, turn) for turn in (*edges, angle)]
    moments = [np.sign(arm[:, 0] * line[:, 1] - arm[:, 1] * line[:, 0]) for line in lines]
    return np.asarray(np.where((moments[0] == moments[1]) & (moments[1] == moments[2]), moments[0], 0.0))


def _sign_beyond(values: Array, least: float) -> Array:
    return np.asarray(np.where(np.abs(values) > least, np.sign(values), 0.0))


def _finding(name: str, what: str, agreements: dict[str, Agreement]) -> Finding:
    shares = " and ".join(f"{each.share:.2f}" for each in agreements.values())
    sentence = f"The table's {what}: agreement with mechanics {shares}, from -1 to 1."
    values = {column: Value(each.share, "1") for column, each in agreements.items()}
    return Finding(name, "warning", sentence, FRAMES, values)
