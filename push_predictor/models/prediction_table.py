"""Predictions of a learnt model tabulated over a box: an answer costs the same however many rows it learnt from.

Per output: the mean and the variance of f, and the log process variance, which is what is smooth: the variance of f has
narrow dips at the training pushes, of quadratic shape. Each posterior is read at Chebyshev nodes as dense as its own
lengthscales ask for; all share the knots of one spline.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain
from math import exp

import numpy as np

from push_predictor.errors import PushPredictorError
from push_predictor.models.grid_posterior import GridPosterior, GridRegression, grid_regression
from push_predictor.models.interpolation import Axis, TensorSpline, along
from push_predictor.models.kernels import ArdKernel, SquaredExponential
from push_predictor.models.push_chart import Chart, Whole
from push_predictor.models.push_model import LearnedBody, Scaling
from push_predictor.types import Array

MOST_KNOTS = 1_000_000  # 72 MB
MOST_NODES = 150_000  # of one posterior and edge: some seconds
FEWEST_NODES = 10
FEWEST_CELLS = 16
_PATH = 65  # points along which lengthscales are counted


@dataclass(frozen=True)
class Density:
    """Nodes and cells a lengthscale."""

    nodes: float
    cells: float


SIGNAL = Density(nodes=4.0, cells=12.0)  # the signal is wanted to a small part of the noise, the noise to one of itself
NOISE = Density(nodes=2.5, cells=6.0)


class TooFineError(PushPredictorError):
    """A model varies too fast for a table of a reasonable size, or its kernels allow none."""


@dataclass(frozen=True, eq=False)
class PredictionTable:
    """columns: which of velocity, place and angle the splines run over; least: of the variances of f; knots: how
    many in all.
    """

    spline: TensorSpline
    columns: slice
    least: list[float]
    knots: int

    def moments(self, points: Array, box: Whole) -> tuple[Array, Array, Array]:
        """Mean, outcome variance and process variance, (n, 3) each in SI units, at (n, 3) velocity, place, angle."""
        values = self.spline(points[:, self.columns], box)
        process = np.exp(values[:, 6:])
        return values[:, :3], np.maximum(values[:, 3:6], self.least) + process, process

    def moments_one(self, point: Sequence[float], box: int) -> tuple[list[float], list[float], list[float]]:
        """The same for one point, in plain numbers."""
        values = self.spline.at(point[self.columns], box).tolist()
        process = [exp(value) for value in values[6:]]
        total = [max(v, least) + p for v, least, p in zip(values[3:6], self.least, process, strict=True)]
        return values[:3], total, process


def tabulate(body: LearnedBody, chart: Chart, low: Array, high: Array, refinement: float = 1.0) -> PredictionTable:
    """The table over the box of velocity, place and angle from low (3,) to high (3,).

    refinement: how many times as many nodes and knots along each axis as usual. Raises TooFineError, also for kernels
    that are no products over the axes.
    """
    regressions = [grid_regression(regression) for regression in body.regressions]
    if not all(isinstance(regression.signal.kernel, SquaredExponential) for regression in regressions):
        raise TooFineError("only squared exponential kernels are products over the axes of a table")
    sides = _sides(body.scaling, chart, low, high)
    axes = [Axis(side.low, side.high, _cells(side, regressions, refinement)) for side in sides]
    knots = chart.boxes * int(np.prod([axis.cells + 1.0 for axis in axes]))
    if knots > MOST_KNOTS:
        raise TooFineError(f"{knots} knots would be needed, at most {MOST_KNOTS} are taken")
    grid = _Grid(sides, axes, refinement)
    outputs = [grid.outputs(regression) for regression in regressions]
    values = np.stack(list(chain(*zip(*outputs, strict=True))), axis=-1)
    values = np.repeat(values, chart.boxes // len(values), axis=0)  # where the place does not vary, all edges are one
    sd, zero = body.scaling.outcome_sd, np.zeros(3)
    values *= np.concatenate([sd, sd**2, np.ones(3)])
    values += np.concatenate([body.scaling.outcome_mean, zero, 2.0 * np.log(sd)])
    least = (sd**2 * [regression.signal.least_variance for regression in regressions]).tolist()
    return PredictionTable(TensorSpline(axes, values), _as_slice([side.column for side in sides]), least, knots)


@dataclass(frozen=True, eq=False)
class _Side:
    """One of velocity, place and angle that the model uses: `used` are its columns among the model's features."""

    column: int
    low: float
    high: float
    used: list[int]
    features: Callable[[Array], Array]  # values (m,) -> standardised features (boxes, m, len(used))

    def lengthscales(self, kernel: ArdKernel) -> float:
        """How many lengthscales of a kernel lie between low and high; around a closed outline 2 pi at least."""
        path = self._scaled(kernel, self.features(np.linspace(self.low, self.high, _PATH))[0])
        length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
        return max(length, 2.0 * np.pi) if len(self.used) > 1 else length

    def correlations(self, posterior: GridPosterior, values: Array) -> Array:
        """The factor (boxes m, n) of the kernel between values (m,) and the inputs."""
        points = self._scaled(posterior.kernel, self.features(values)).reshape(-1, 1, len(self.used))
        inputs = self._scaled(posterior.kernel, posterior.inputs[:, self.used])
        return np.asarray(np.exp(-0.5 * ((points - inputs) ** 2).sum(axis=2)))

    def _scaled(self, kernel: ArdKernel, features: Array) -> Array:
        return np.asarray(features / np.exp(kernel.log_lengthscales[self.used]))


def _sides(scaling: Scaling, chart: Chart, low: Array, high: Array) -> list[_Side]:
    groups = ((0,), chart.place_columns, (len(chart.place_columns) + 1,))
    sides = []
    for column, (group, features) in enumerate(zip(groups, (_itself, _places(chart), _itself), strict=True)):
        chosen = [k for k, feature in enumerate(group) if feature in scaling.columns]
        if chosen:
            used = [scaling.columns.index(group[k]) for k in chosen]
            standardised = _standardised(features, chosen, scaling.feature_mean[used], scaling.feature_sd[used])
            sides.append(_Side(column, float(low[column]), float(high[column]), used, standardised))
    return sides


def _itself(values: Array) -> Array:
    return values[None, :, None]


def _places(chart: Chart) -> Callable[[Array], Array]:
    """Features (boxes, m, columns) of the places (m,) of every box."""
    return lambda places: np.stack([np.column_stack(chart.place_features(places, k)) for k in range(chart.boxes)])


def _standardised(
    features: Callable[[Array], Array], chosen: list[int], mean: Array, sd: Array
) -> Callable[[Array], Array]:
    return lambda values: (features(values)[:, :, chosen] - mean) / sd


def _as_slice(columns: Sequence[int]) -> slice:
    """Any columns out of three, without a copy."""
    return slice(columns[0], columns[-1] + 1, columns[-1] - columns[0] if len(columns) == 2 else 1)


def _cells(side: _Side, regressions: Sequence[GridRegression], refinement: float) -> int:
    wanted = [SIGNAL.cells * side.lengthscales(r.signal.kernel) for r in regressions]
    wanted += [NOISE.cells * side.lengthscales(r.noise.kernel) for r in regressions if r.noise]
    return max(FEWEST_CELLS, int(np.ceil(refinement * max(wanted))))


@dataclass(frozen=True, eq=False)
class _Grid:
    """The knots of a table."""

    sides: Sequence[_Side]
    axes: Sequence[Axis]
    refinement: float

    def outputs(self, regression: GridRegression) -> list[Array]:
        """Mean and variance of f, and log process variance, at the knots, (boxes, cells_1 + 1, ...) each.

        Where the place is none of the sides, there is one box.
        """
        mean, variance = self._moments(regression.signal, SIGNAL)
        if regression.noise is None:
            return [mean, variance, np.full_like(mean, regression.log_noise)]
        log_mean, spread = self._moments(regression.noise, NOISE)
        return [mean, variance, regression.log_noise + log_mean + 0.5 * spread]

    def _moments(self, posterior: GridPosterior, density: Density) -> tuple[Array, Array]:
        wanted = [density.nodes * side.lengthscales(posterior.kernel) for side in self.sides]
        counts = [int(self.refinement * (FEWEST_NODES + count)) for count in wanted]
        if (total := float(np.prod(counts, dtype=np.float64))) > MOST_NODES:
            raise TooFineError(f"{total:.0f} nodes would be needed, at most {MOST_NODES} are taken")
        nodes = [axis.nodes(count) for axis, count in zip(self.axes, counts, strict=True)]
        factors = [side.correlations(posterior, values) for side, values in zip(self.sides, nodes, strict=True)]
        mean, variance = posterior.moments(factors)
        return self._at_knots(mean, counts), self._at_knots(variance, counts)

    def _at_knots(self, values: Array, counts: Sequence[int]) -> Array:
        """From nodes, the boxes of the place's axis one after the other, to knots with the boxes first."""
        shape = list(chain(*((size // count, count) for size, count in zip(values.shape, counts, strict=True))))
        order = [*range(0, len(shape), 2), *range(1, len(shape), 2)]
        values = values.reshape(shape).transpose(order).reshape(-1, *counts)
        for d, (axis, count) in enumerate(zip(self.axes, counts, strict=True)):
            values = along(d + 1, axis.nodes_to_knots(count), values)
        return values
