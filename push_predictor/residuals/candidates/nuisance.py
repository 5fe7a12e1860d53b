# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Columns that candidates are projected off, because they occur without the effect.

A touch that is detected early or late shifts the window that begins with it, not the slider: the contact with a heavier
slider is detected sooner. And an effect that depends on a covariate must explain more than the constant effects of all
mechanisms: a centre of friction that was always off must not be put down to the side that was pushed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.residuals.evidence.drivers import SETTLED
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, Kind, controls_for
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.standardised import Evidence, whitened_response
from push_predictor.types import Array

FELT = 1e-3  # of a direction's length; less than this, regressed on the inputs, is numerical noise
Key = tuple[bool, bool, str | None, Kind]


@dataclass(frozen=True, eq=False)
class Nuisance:
    """The nuisance columns of candidates on these windows.

    mechanisms: all that are usable. response: the standardised response (n, 3, p) of one.
    """

    evidence: Evidence
    inputs: InputsBasis
    mechanisms: Sequence[str]
    response: Callable[[str | None], Array]
    known: dict[Key, Array | None] = field(default_factory=dict)

    def of_change(self, mechanism: str | None, covariate: str, basis: DriverBasis, kind: Kind) -> Array | None:
        """Orthonormal columns (3 n, q) for a candidate that changes an effect which may exist anyway; None if none."""
        own = mechanism if basis.is_constant else None
        key = kind != "driven", kind != "constant", own, kind
        if key not in self.known:
            self.known[key] = self._columns(*key)
        return self.known[key]

    def _columns(self, touch: bool, constants: bool, kept: str | None, kind: Kind) -> Array | None:
        parts = [self._late_touch] if touch else []
        if constants:
            parts += [self.response(name) for name in self.mechanisms if name != kept]
        columns = np.concatenate(parts, axis=2) if parts else np.empty((len(self.evidence.table), 3, 0))
        return _orthonormal(columns, Residualizer(controls_for(kind, self.inputs)))

    @cached_property
    def _late_touch(self) -> Array:
        since = self.evidence.table.covariates.get("time_since_contact")
        if since is None:
            return np.empty((len(self.evidence.table), 3, 0))
        first = (since < SETTLED).astype(np.float64)
        return whitened_response(self.evidence, "pusher_travel") * first[:, None, None]


def _orthonormal(columns: Array, residualizer: Residualizer) -> Array | None:
    before = columns.reshape(3 * len(columns), -1)
    size = np.linalg.norm(before, axis=0)
    kept = size > 0.0
    if not kept.any():
        return None
    residual = residualizer(columns).reshape(before.shape)[:, kept] / size[kept]
    # Of the products: a tenth of the time of a singular value decomposition, and exact enough for values above FELT.
    squares, turn = np.linalg.eigh(residual.T @ residual)
    felt = squares > FELT**2
    return np.asarray(residual @ turn[:, felt] / np.sqrt(squares[felt])) if felt.any() else None
