"""How large an effect is, in the physical unit of its mechanism."""

from __future__ import annotations

import numpy as np

from push_predictor.models.effects.effect import Effect, mechanism_named
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.outcome import Sized
from push_predictor.types import Array

ENDS = (0.05, 0.95)  # of the driver's windows: the range over which a change is told
DRAWS = 2000


def size_of(effect: Effect, table: PushTable) -> Sized | None:
    """The mechanism's parameter, or its change along the driver, with a 95 % interval; None for the generic effect.

    Of a constant: the parameter itself. Of a form of one driver: its change from the 5th to the 95th percentile of the
    driver's windows. Of forms that turn (headings, categories, maps): the largest difference over the windows. A
    mechanism of two parameters is told by the length of its vector.
    """
    if effect.mechanism is None:
        return None
    parameters = mechanism_named(effect.mechanism).parameters
    change = _change(effect, table)
    estimate = _length(effect.coefficients, change, len(parameters))
    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal(effect.coefficients, effect.covariance, size=DRAWS, method="svd")
    lengths = np.array([_length(row, change, len(parameters)) for row in drawn])
    low, high = np.quantile(lengths, [0.025, 0.975])
    name = parameters[0].name if len(parameters) == 1 else f"{effect.mechanism.replace('_', ' ')}, length of its vector"
    told = name if effect.form.name == "constant" else f"{name}, change over {effect.covariate}"
    return Sized(told, float(estimate), float(low), float(high), parameters[0].unit)


def _change(effect: Effect, table: PushTable) -> Array:
    """Difference (m,) of the form's columns between the two ends at which they are compared."""
    form = effect.form
    values = form.values(table.covariates, len(table))
    if form.name == "constant":
        return np.ones(1)
    if form.name in ("linear", "logarithmic", "quadratic", "step"):
        driver = np.asarray(table.covariates[form.drivers[0]])
        low, high = (int(np.argmin(np.abs(driver - np.quantile(driver, share)))) for share in ENDS)
        return np.asarray(values[high] - values[low])
    strength = values @ effect.coefficients.reshape(-1, values.shape[1])[0]
    return np.asarray(values[int(np.argmax(strength))] - values[int(np.argmin(strength))])


def _length(coefficients: Array, change: Array, count: int) -> float:
    """Change of the one parameter with its sign, or the length of that of several."""
    changes = coefficients.reshape(count, -1) @ change
    return float(changes[0]) if count == 1 else float(np.linalg.norm(changes))
