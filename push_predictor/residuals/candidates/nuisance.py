"""What is taken out of candidates because it comes without the effect.

A touch that is felt earlier or later shifts the window that begins with it, not the slider: a heavier slider is felt
sooner. And a driver acts beside what the mechanisms do without one: where the centre of friction has always been off,
or friction is another than the base has it, no driver must be named for it because it happened to go with a side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.residuals.evidence.drivers import SETTLED
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, Kind, inputs_of
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.standardised import Evidence, whitened_response
from push_predictor.types import Array

TOUCHED = ("time_since_contact", "contact_gap")  # differ between the window that begins with the touch and later ones
FELT = 1e-3  # of a direction's length before the inputs were taken out; below it nothing is left to take out
Key = tuple[bool, bool, str | None, Kind]


@dataclass(frozen=True, eq=False)
class Nuisance:
    """What goes out of candidates on these windows. response: whitened, of a mechanism (n, 3, p); mechanisms: all."""

    evidence: Evidence
    basis: InputsBasis
    mechanisms: Sequence[str]
    response: Callable[[str | None], Array]
    known: dict[Key, Array | None] = field(default_factory=dict)

    def beside(self, mechanism: str | None, covariate: str, form: DriverBasis, kind: Kind) -> Array | None:
        """Orthonormal columns (3 n, q) that go out of those of a candidate, the inputs taken out of them; or None."""
        return self._out_of(mechanism if form.name == "constant" else None, covariate, kind)

    def whole(self, mechanism: str | None, covariate: str, kind: Kind) -> Array | None:
        """The same, but what the mechanism does without a driver stays: for a driver under which it begins at zero."""
        return self._out_of(mechanism, covariate, kind)

    def _out_of(self, alone: str | None, covariate: str, kind: Kind) -> Array | None:
        key = covariate in TOUCHED or kind != "driven", kind != "constant", alone, kind
        if key not in self.known:
            self.known[key] = self._columns(*key)
        return self.known[key]

    def _columns(self, touch: bool, undriven: bool, alone: str | None, kind: Kind) -> Array | None:
        parts = [self._late_touch()] if touch else []
        if undriven:
            parts += [self.response(name) for name in self.mechanisms if name != alone]
        columns = np.concatenate(parts, axis=2) if parts else np.empty((len(self.evidence.table), 3, 0))
        return _orthonormal(columns, Residualizer(inputs_of(kind, self.basis)))

    def _late_touch(self) -> Array:
        since = self.evidence.table.covariates.get("time_since_contact")
        if since is None:
            return np.empty((len(self.evidence.table), 3, 0))
        first = (since < SETTLED).astype(np.float64)
        return whitened_response(self.evidence, "pusher_travel") * first[:, None, None]


def _orthonormal(columns: Array, out: Residualizer) -> Array | None:
    before = columns.reshape(3 * len(columns), -1)
    size = np.linalg.norm(before, axis=0)
    kept = size > 0.0
    if not kept.any():
        return None
    left = out(columns).reshape(before.shape)[:, kept] / size[kept]
    vectors, values, _ = np.linalg.svd(left, full_matrices=False)
    return np.asarray(vectors[:, values > FELT]) if values[0] > FELT else None
