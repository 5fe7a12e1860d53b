# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""How well a choice of free parameters predicts held-out pushes: push-blocked cross-validation of a joint fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from push_predictor.models.mechanics.fit import JointFit, student_curvature, student_loss, student_weights
from push_predictor.types import Array

FOLDS = 10


class CrossValidation:
    """Held-out predictions under choices among the parameters of a fit.

    Each fold's fit is one Gauss-Newton step from the joint one, with its weights and scale. A parameter of the fit that
    a choice lacks returns to its textbook value, to first order.
    """

    def __init__(self, fit: JointFit) -> None:
        self.fit = fit
        pushes = fit.rows.pushes
        fold = np.random.default_rng(0).permutation(pushes) % min(FOLDS, pushes)
        self.fold = fold[fit.rows.push]
        table = fit.rows.named(fit.names)
        self._textbook = np.array([parameter.textbook for parameter in table])
        self._prior = np.array([parameter.spread for parameter in table]) ** -2.0
        self._values = np.array([fit.values[name] for name in fit.names])
        scaled = fit.residuals / fit.scale
        weight, bend = student_weights(scaled) / fit.scale**2, student_curvature(scaled) / fit.scale**2
        rows = [self.fold != k for k in range(int(self.fold.max()) + 1)]
        bent, pulls = fit.jacobian * bend[:, :, None], weight * fit.residuals
        grams = [np.tensordot(bent[~kept], fit.jacobian[~kept], ((0, 1), (0, 1))) for kept in rows]
        slopes = [np.einsum("nkp,nk->p", fit.jacobian[~kept], pulls[~kept]) for kept in rows]
        self._curvature = np.sum(grams, axis=0) - np.array(grams)
        self._slope = np.sum(slopes, axis=0) - np.array(slopes)

    def residuals(self, names: Sequence[str]) -> Array:
        """Residuals (n, 3) of each push under the parameters `names` fitted without its fold."""
        free = [self.fit.names.index(name) for name in names]
        dropped = [k for k in np.flatnonzero(self._values != self._textbook).tolist() if k not in free]
        change = np.zeros((len(self._slope), len(self.fit.names)))
        change[:, dropped] = (self._textbook - self._values)[dropped]
        if free:
            slope = self._slope[:, free] - np.einsum(
                "kfd,d->kf", self._curvature[:, free][:, :, dropped], change[0, dropped]
            )
            slope = slope + self._prior[free] * (self._textbook - self._values)[free]
            curvature = self._curvature[:, free][:, :, free] + np.diag(self._prior[free])
            change[:, free] = np.linalg.solve(curvature, slope[:, :, None])[:, :, 0]
        used = [*free, *dropped]
        explained = np.einsum("nkp,np->nk", self.fit.jacobian[:, :, used], change[self.fold][:, used])
        return np.asarray(self.fit.residuals - explained)

    def scores(self, names: Sequence[str]) -> Array:
        """Negative log density (pushes,) of each held-out push by Student's t, up to a constant."""
        density = student_loss(self.residuals(names) / self.fit.scale).sum(axis=1) + np.log(self.fit.scale).sum()
        return np.bincount(self.fit.rows.push, density).astype(np.float64)


def held_out_scores(fit: JointFit) -> Array:
    """Negative log density (pushes,) of each held-out push under the parameters of the fit, up to a constant."""
    return CrossValidation(fit).scores(fit.names)
