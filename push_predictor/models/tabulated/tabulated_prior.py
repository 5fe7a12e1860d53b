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

"""A prior predictor that answers from a table: its moments depend on contact, angle and the distance travelled alone.

A prediction integrates some seventy pushes, which takes milliseconds. Its moments are averages over the draws, so they
are smoother than the mechanics, and the width of a prior model is not known to better than some per cent. So a coarse
table is accurate enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.outline import Outline
from push_predictor.models.mechanics.process_noise import TRACKER
from push_predictor.models.mechanisms import Push
from push_predictor.models.predictors import Moments, PriorPredictor
from push_predictor.models.predictors.prior_predictor import STEEPEST
from push_predictor.models.tabulated.interpolation import Axis, TensorSpline
from push_predictor.types import Array, BoolArray, IntArray

TRAVEL = (5e-4, 0.03)  # m; one axis is the logarithm of the distance travelled
CELL = 0.0075  # m along the outline
ANGLE_CELLS, TRAVEL_CELLS, FEWEST_CELLS = 14, 4, 5
MOST_KNOTS = 10_000  # a millisecond each
PROBES = 60
MEAN_TOLERANCE, SPREAD_TOLERANCE = 0.3, 0.4  # standard deviations; relative, of a standard deviation: near corners
NEXT_TO_CORNER = 1e-6  # of an edge: a corner itself belongs to the next one
JITTER = 1e-6  # of the distance travelled: draws may agree
_ROWS, _COLUMNS = np.tril_indices(3)


@dataclass(frozen=True, eq=False)
class TabulatedPrior(PriorPredictor):
    """A PriorPredictor with its table; pushes that the table does not contain are integrated.

    spline: per edge of a polygon, or for the whole of a smooth outline, the mean and the roots of both covariances,
    divided by the distance travelled and without the tracker's noise.
    """

    spline: TensorSpline

    def moments(self, push: Push) -> Moments:
        """See Predictor; within some per cent of a standard deviation of the PriorPredictor's."""
        travel = push.inputs[:, 0] * push.duration
        inside = self._inside(push.inputs, travel)
        if inside.all():
            return self._tabulated(push.inputs, travel)
        exact = super().moments(Push(push.inputs[~inside], push.duration[~inside], {}))
        if not inside.any():
            return exact
        table, parts = self._tabulated(push.inputs[inside], travel[inside]), []
        for one, other in zip(table, exact, strict=True):
            part = np.empty((len(travel), *one.shape[1:]))
            part[inside], part[~inside] = one, other
            parts.append(part)
        return Moments(*parts)

    @staticmethod
    def _inside(inputs: Array, travel: Array) -> BoolArray:
        return np.asarray((np.abs(inputs[:, 2]) <= STEEPEST) & (travel >= TRAVEL[0]) & (travel <= TRAVEL[1]))

    def _tabulated(self, inputs: Array, travel: Array) -> Moments:
        box, place = _place(self.fitted.mechanics.outline, inputs[:, 1])
        values = self.spline(np.column_stack([place, inputs[:, 2], np.log(travel)]), box)
        values = values * travel[:, None]
        noise = _squared(values[:, 9:])
        index = np.arange(3)
        noise[:, index, index] += self.noise.factor * np.square(TRACKER)
        return Moments(values[:, :3], _squared(values[:, 3:9]) + noise, noise)


def tabulated_prior(predictor: PriorPredictor) -> tuple[TabulatedPrior | None, str]:
    """The predictor with its table, None where a table does not suit it, and in words how it predicts.

    Takes some seconds.
    """
    boxes, axes = _axes(predictor.fitted.mechanics.outline)
    knots = boxes * int(np.prod([axis.cells + 1 for axis in axes]))
    if predictor.needs or knots > MOST_KNOTS:
        why = "the mechanics depend on the recording" if predictor.needs else f"{knots} knots would be needed"
        return None, f"exact: {why}"
    table = _table(predictor, boxes, axes)
    how, accurate = compared(predictor, table)
    return (table, f"table of {knots} knots, {how}") if accurate else (None, f"exact: a table gives {how}; too far off")


def with_spline(predictor: PriorPredictor, spline: TensorSpline) -> TabulatedPrior:
    """The predictor with a table that was computed before."""
    return TabulatedPrior(predictor.fitted, predictor.draws, predictor.noise, spline)


def compared(predictor: PriorPredictor, table: TabulatedPrior, probes: int = PROBES) -> tuple[str, bool]:
    """In words, how far the table is from the predictor, and whether that is near enough."""
    of_mean, of_spread = _errors(predictor, table, probes)
    how = f"means to {of_mean:.2g} standard deviations, standard deviations to {100.0 * of_spread:.2g} %"
    return how, bool(of_mean <= MEAN_TOLERANCE and of_spread <= SPREAD_TOLERANCE)


def _errors(predictor: PriorPredictor, table: TabulatedPrior, probes: int) -> tuple[float, float]:
    """The largest differences of means, in standard deviations, and of standard deviations, relative."""
    rng = np.random.default_rng(0)
    inputs = np.column_stack([np.ones(probes), rng.random(probes), rng.uniform(-STEEPEST, STEEPEST, probes)])
    push = Push(inputs, np.exp(rng.uniform(np.log(TRAVEL[0]), np.log(TRAVEL[1]), probes)), {})
    exact, found = predictor.moments(push), table.moments(push)
    sd, own = (np.sqrt(np.diagonal(m.covariance, axis1=1, axis2=2)) for m in (exact, found))
    return float(np.max(np.abs(found.mean - exact.mean) / sd)), float(np.max(np.abs(own / sd - 1.0)))


def _table(predictor: PriorPredictor, boxes: int, axes: list[Axis]) -> TabulatedPrior:
    outline = predictor.fitted.mechanics.outline
    knots = [np.linspace(axis.low, axis.high, axis.cells + 1) for axis in axes]
    grid = np.stack(np.meshgrid(np.arange(boxes), *knots, indexing="ij"), axis=-1)
    box, place, angle, log_travel = np.asarray(grid.reshape(-1, 4), dtype=np.float64).T
    travel = np.exp(log_travel)
    inputs = np.column_stack([travel, _contact(outline, box.astype(np.int64), place), angle])
    moments = predictor.moments(Push(inputs, np.ones(len(inputs)), {}))
    noise = moments.process_covariance - np.diag(predictor.noise.factor * np.square(TRACKER))
    of_draws = moments.covariance - moments.process_covariance
    values = np.concatenate([moments.mean, _roots(of_draws, travel), _roots(noise, travel)], axis=1) / travel[:, None]
    spline = TensorSpline.through(axes, values.reshape(*grid.shape[:-1], values.shape[1]))
    return with_spline(predictor, spline)


def _axes(outline: Outline) -> tuple[int, list[Axis]]:
    """Number of boxes, and the axes place, angle and logarithm of the distance travelled."""
    lengths = np.diff(outline.edge_starts) * outline.perimeter
    boxes, longest = (1, lengths.sum()) if outline.semi_axes is not None else (len(lengths), lengths.max())
    cells = max(FEWEST_CELLS, round(float(longest) / CELL))
    low, high = np.log(TRAVEL).tolist()
    return boxes, [Axis(0.0, 1.0, cells), Axis(-STEEPEST, STEEPEST, ANGLE_CELLS), Axis(low, high, TRAVEL_CELLS)]


def _place(outline: Outline, contact: Array) -> tuple[IntArray, Array]:
    """Box and place (n,) of contacts (n,). Places on an edge are denser next to its corners, where more happens."""
    if outline.semi_axes is not None:
        return np.zeros(len(contact), dtype=np.int64), contact
    edge, fraction = outline.edge(contact)
    return edge, np.arccos(1.0 - 2.0 * fraction) / np.pi


def _contact(outline: Outline, box: IntArray, place: Array) -> Array:
    if outline.semi_axes is not None:
        return place % 1.0
    fraction = 0.5 - 0.5 * np.cos(np.pi * place)
    return outline.contact_on_edge(box, np.clip(fraction, NEXT_TO_CORNER, 1.0 - NEXT_TO_CORNER))


def _roots(covariance: Array, travel: Array) -> Array:
    """Lower roots (n, 6) of covariances (n, 3, 3)."""
    roots = np.linalg.cholesky(covariance + (JITTER * travel[:, None, None]) ** 2 * np.eye(3))
    return np.asarray(roots[:, _ROWS, _COLUMNS])


def _squared(lower: Array) -> Array:
    root = np.zeros((len(lower), 3, 3))
    root[:, _ROWS, _COLUMNS] = lower
    return np.asarray(root @ root.transpose(0, 2, 1))
