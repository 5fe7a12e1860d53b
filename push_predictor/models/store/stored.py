# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a model file may contain: its classes by name, what is not written of them, and which values are accepted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from push_predictor.models.effects.covariates import CUMULATIVE
from push_predictor.models.effects.driver_basis import DriverBasis, columns_of
from push_predictor.models.effects.effect import GENERIC_WIDTH, Effect
from push_predictor.models.effects.exact import covariance_of
from push_predictor.models.effects.traced_session import Mark, TracedSession
from push_predictor.models.gaussian_process.bound import VhgpParameters
from push_predictor.models.gaussian_process.gp import GaussianProcess, GpParameters
from push_predictor.models.gaussian_process.regression import ConstantNoise, ConstantParameters
from push_predictor.models.gaussian_process.sparse_vhgp import SparseVHGP
from push_predictor.models.gaussian_process.vhgp import VHGP
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.pressure import PressureDistribution
from push_predictor.models.mechanics.prior import VARYING, ProcessNoise
from push_predictor.models.mechanics.surface import PowerSurface
from push_predictor.models.mechanisms import mechanism_named
from push_predictor.models.predictors import (
    BasePredictor,
    ExtendedPredictor,
    GaussianProcessPredictor,
    MechanicsPredictor,
    PriorPredictor,
    Scaling,
    Tails,
)
from push_predictor.models.predictors.correlation import Correlation
from push_predictor.models.predictors.tails import STEPS
from push_predictor.models.push_model import Provenance
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

REGRESSIONS = (GaussianProcess, VHGP, SparseVHGP, ConstantNoise)
BASES_OF_EFFECTS = (GaussianProcessPredictor, MechanicsPredictor, PriorPredictor)
CLASSES: dict[str, type] = {
    cls.__name__: cls
    for cls in (
        *(Provenance, PushTable, *BASES_OF_EFFECTS, ExtendedPredictor, Effect, DriverBasis, TracedSession, Mark),
        *(Scaling, Tails, Correlation, *REGRESSIONS, GpParameters, VhgpParameters, ConstantParameters),
        *(FittedMechanics, PushMechanics, PressureDistribution, PowerSurface, ProcessNoise),
    )
}
CHOICES: dict[Any, tuple[type, ...]] = {BasePredictor: BASES_OF_EFFECTS}
# What follows from the rig and from the training rows.
GIVEN = {(cls, name) for cls in REGRESSIONS for name in ("inputs", "outputs")} | {
    (GaussianProcessPredictor, "rig"),
    (GaussianProcessPredictor, "regressions"),
    (GaussianProcessPredictor, "correlation"),
    (Correlation, "features"),
    (PushMechanics, "outline"),
    (PushMechanics, "pusher_radius"),
}
# Seven digits are enough for conditions of a push; a correlation rounds its residuals itself.
SINGLE = {(PushTable, "covariates"), (Correlation, "residuals")}

LONGEST_PUSH = 10.0  # m
LARGEST_RATIO = 100.0  # of the support's or the pusher's size to the outline's
MOST_DRAWS = 10_000
LATEST = 2**62  # ns, of a stamp
DRIVERS = {"constant": 0, "map": 2}  # how many a basis takes; all others one
SCALED = ("linear", "quadratic", "map", "logarithmic")
POSITIVE, ABOVE_ONE, ABOVE_TWO = np.finfo(np.float64).tiny, np.nextafter(1.0, 2.0), np.nextafter(2.0, 3.0)


@dataclass(frozen=True)
class Limits:
    """Least and largest accepted number of a field, and the shape of an array."""

    least: float = -np.inf
    most: float = np.inf
    shape: tuple[int, ...] | None = None


LIMITS: dict[tuple[type, str], Limits] = {
    (Correlation, "bandwidth"): Limits(POSITIVE),
    (Correlation, "shrinkage"): Limits(POSITIVE),
    (Tails, "scale"): Limits(POSITIVE, shape=(3,)),
    (Tails, "degrees"): Limits(ABOVE_TWO, shape=(3,)),
    (Tails, "joint_scale"): Limits(POSITIVE),
    (Tails, "joint_degrees"): Limits(ABOVE_TWO),
    (Tails, "pushes"): Limits(1),
    (Tails, "quantiles"): Limits(0.0, shape=(STEPS, 3)),
    (Scaling, "travel"): Limits(POSITIVE),
    (Scaling, "speeds"): Limits(POSITIVE, shape=(2,)),
    (MechanicsPredictor, "covariance"): Limits(shape=(3, 3)),
    (ExtendedPredictor, "scale"): Limits(POSITIVE, shape=(3,)),
    (Effect, "outcome_scale"): Limits(shape=(3,)),
    (ProcessNoise, "factor"): Limits(POSITIVE, shape=(3,)),
    (PushMechanics, "accuracy"): Limits(1e-7, 0.1),
    (PowerSurface, "centre"): Limits(shape=(2,)),
    (PowerSurface, "power"): Limits(ABOVE_ONE, 100.0),
    (ConstantParameters, "noise_spread"): Limits(0.0, 10.0),
    (VHGP, "site_precisions"): Limits(0.0),
    (SparseVHGP, "site_precisions"): Limits(0.0),
}


def check(cls: type, arguments: Mapping[str, Any], place: str) -> None:
    """Raise ValueError, which names the place, for arguments of a constructor that no model has.

    So a computation with them ends, in the time and memory that a model needs.
    """
    for name, value in arguments.items():
        if value is None:  # where the class accepts it
            continue
        numbers = np.asarray(value) if isinstance(value, int | float | tuple | np.ndarray) else np.zeros(0)
        if numbers.dtype.kind == "f" and not np.all(np.isfinite(numbers)):
            raise ValueError(f"{place}.{name}: a number is not finite")
        limits = LIMITS.get((cls, name), Limits())
        if limits.shape is not None and numbers.shape != limits.shape:
            raise ValueError(f"{place}.{name}: shape {numbers.shape} is not accepted, give {limits.shape}")
        if (cls, name) in LIMITS and not np.all((numbers >= limits.least) & (numbers <= limits.most)):
            raise ValueError(f"{place}.{name}: numbers from {limits.least:g} to {limits.most:g} are accepted")
    if cls in CHECKS:
        try:
            CHECKS[cls](SimpleNamespace(**arguments))
        except (ValueError, TypeError, KeyError, IndexError) as error:
            raise ValueError(f"{place}: {error}") from None


def _table(a: SimpleNamespace) -> None:
    if not np.all(np.abs(a.inputs[:, 0] * a.duration) < LONGEST_PUSH):
        raise ValueError(f"a training push is longer than {LONGEST_PUSH:g} m")


def _tails(a: SimpleNamespace) -> None:
    if np.any(np.diff(a.quantiles, axis=0) < 0.0):
        raise ValueError("quantiles decrease")


def _correlation(a: SimpleNamespace) -> None:
    if a.rows is not None and np.any(a.rows < 0):
        raise ValueError("rows: a number of a training row is negative")


def _regression(a: SimpleNamespace) -> None:
    """One length scale for each input; others would be broadcast."""
    for name, found in vars(a.parameters).items():
        if name.endswith("log_lengthscales") and found.shape != a.inputs.shape[1:]:
            raise ValueError(f"parameters.{name}: shape {found.shape} is not accepted, give {a.inputs.shape[1:]}")


def _sparse(a: SimpleNamespace) -> None:
    _regression(a)
    for name in ("inducing_signal", "inducing_noise"):
        rows = getattr(a, name)
        if rows.ndim != 1 or np.any(rows < 0) or not 0 < len(np.unique(rows)) == len(rows):
            raise ValueError(f"{name} does not contain distinct rows")


def _fitted(a: SimpleNamespace) -> None:
    for name, value in a.values.items():
        _check_parameter(name, value, value)
    if a.covariance.shape != (len(a.values), len(a.values)):
        raise ValueError(f"covariance of shape {a.covariance.shape}, {len(a.values)} rows and columns are needed")


def _check_parameter(name: str, least: float, most: float) -> None:
    if name not in BY_NAME:
        raise ValueError(f"{name!r} is no parameter of the mechanics")
    if not BY_NAME[name].low <= least <= most <= BY_NAME[name].high:
        raise ValueError(f"{name} {least:g}, {most:g}: {BY_NAME[name].low} to {BY_NAME[name].high} is accepted")


def _mechanics(a: SimpleNamespace) -> None:
    """Integration on a support far larger or smaller than the slider would take long."""
    reach, supports = float(np.abs(a.outline.vertices).max()), [s for s in (a.support, *a.supports.values()) if s]
    for support in supports:
        known = isinstance(support, PressureDistribution)
        largest = max(np.abs(support.points if known else support.centre).max(), support.spread if known else 0.0)
        fits = max(float(largest), a.pusher_radius) < LARGEST_RATIO * reach and support.length > reach / LARGEST_RATIO
        if not fits or (known and support.spread < 0.0):
            raise ValueError("support points are far too large or too close together for the outline")


def _prior(a: SimpleNamespace) -> None:
    names = list(a.fitted.values)
    if a.draws.ndim != 2 or a.draws.shape[1] != len(names) or not 2 <= len(a.draws) <= MOST_DRAWS:
        raise ValueError(f"draws of shape {a.draws.shape}, 2 to {MOST_DRAWS} of {len(names)} are needed")
    for name, column in zip(names, a.draws.T, strict=True):
        _check_parameter(name, column.min(), column.max())
    if missing := [name for name in VARYING if name not in names]:
        raise ValueError(f"the process noise needs the parameter {missing[0]}")


def _basis(a: SimpleNamespace) -> None:
    if len(a.drivers) != (count := DRIVERS.get(a.name, 1)):
        raise ValueError(f"drivers {a.drivers!r} are not accepted for {a.name!r}, give {count} name(s)")
    if a.name in SCALED and not len(a.centre) == len(a.scale) == count:
        raise ValueError(f"centre and scale: {count} number(s) are needed")
    if 0.0 in a.scale:
        raise ValueError("a scale is zero")


def _effect(a: SimpleNamespace) -> None:
    width = GENERIC_WIDTH if a.mechanism is None else len(mechanism_named(a.mechanism).parameters)
    size = width * columns_of(a.basis)
    if a.coefficients.shape != (size,) or a.covariance.shape != (size, size):
        raise ValueError(f"{size} coefficients and their covariance are needed")
    _check_covariance(a.covariance)


def _extended(a: SimpleNamespace) -> None:
    sizes = [len(effect.coefficients) for effect in a.effects]
    for (i, j), shared in a.cross.items():
        if not 0 <= i < j < len(sizes) or shared.shape != (sizes[i], sizes[j]):
            raise ValueError(
                f"cross {i}, {j} of shape {shared.shape}: effects i < j with {sizes} coefficients are needed"
            )
    if sizes:
        _check_covariance(covariance_of(a.effects, a.cross))


def _session(a: SimpleNamespace) -> None:
    if unknown := [name for name in a.now if name not in CUMULATIVE]:
        raise ValueError(f"now: {unknown[0]!r} is no cumulative covariate, give {', '.join(CUMULATIVE)}")
    if not np.all(np.isfinite(list(a.now.values()))):
        raise ValueError("now: a number is not finite")
    stamps = [mark.stamp for mark in a.marks]
    if stamps != sorted(stamps) or not all(abs(stamp) < LATEST for stamp in (*stamps, a.origin or 0)):
        raise ValueError("stamps of a session decrease, or are beyond 64 bits")


def _check_covariance(covariance: Array) -> None:
    sd = np.sqrt(np.maximum(np.diag(covariance), np.finfo(np.float64).tiny))
    relative = covariance / np.outer(sd, sd)  # coefficients have units of their own
    if not np.all(np.isfinite(relative)) or np.linalg.eigvalsh(relative)[0] < -1e-6:
        raise ValueError("the covariance is not positive semidefinite")


CHECKS: dict[type, Callable[[SimpleNamespace], None]] = {
    PushTable: _table,
    Tails: _tails,
    Correlation: _correlation,
    GaussianProcess: _regression,
    VHGP: _regression,
    SparseVHGP: _sparse,
    FittedMechanics: _fitted,
    PushMechanics: _mechanics,
    PriorPredictor: _prior,
    DriverBasis: _basis,
    Effect: _effect,
    ExtendedPredictor: _extended,
    TracedSession: _session,
}
