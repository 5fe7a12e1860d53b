"""What the tables of benchmarks.measured have in common: a model trained and judged, and its row of figures."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_predictor.evaluation.metrics import gaussian_nlpd
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.evaluation.validation import Comparison, compare, metrics_json
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import train_model
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, BoolArray

HEAD = "NMSE (dx dy dtheta) | 95 % of NMSE | NLPD | 95 % of NLPD | exact NLPD | within 95 % (dx dy dtheta)"


@dataclass(frozen=True, eq=False)
class Fold:
    """A model, its predictions of n windows it was not trained on, which of them (n,) lie in its domain, CPU s."""

    model: PushModel
    comparison: Comparison
    in_domain: BoolArray
    cpu: float


def trained(
    table: PushTable, test: PushTable, rig: Rig, kind: str, *, fit: bool = False, n: int | None = None, seed: int = 0
) -> Fold:
    """Train on n rows of one table (all if None), predict another."""
    start = time.process_time()
    model = train_model(table, rig, kind, name=kind, n_train=n, seed=seed, fit=fit)
    cpu = time.process_time() - start
    return Fold(model, compare(model, test), model.predict(test.inputs, test.duration).in_domain, cpu)


def pooled(folds: Sequence[Fold]) -> Comparison:
    """The rows of all folds as one; each row keeps its own model's training mean as reference of the NMSE."""
    parts = [fold.comparison for fold in folds]

    def rows(name: str) -> Array:
        return np.concatenate([getattr(part, name) for part in parts])

    return Comparison(
        model=parts[0].model,
        n_train=min(part.n_train for part in parts),
        push_id=rows("push_id"),
        mean=rows("mean"),
        covariance=rows("covariance"),
        observed=rows("observed"),
        exact_log_density=None if parts[0].exact_log_density is None else rows("exact_log_density"),
        training_mean=np.concatenate([np.tile(part.training_mean, (len(part.mean), 1)) for part in parts]),
    )


def figures(comparison: Comparison) -> str:
    """The cells under HEAD: totals over the outputs in SI units, intervals by resampling whole pushes."""
    m: dict[str, Any] = metrics_json(comparison)
    by_output = " ".join(f"{m['nmse'][name]:.3f}" for name in ("dx", "dy", "dtheta"))
    low_high = {key: f"{m['interval'][key]['low']:.2f} to {m['interval'][key]['high']:.2f}" for key in ("nmse", "nlpd")}
    exact = f"{m['exact_nlpd']['total']:.2f}" if m["exact_nlpd"] else ""
    cover = " ".join(f"{share:.2f}" for share in m["coverage"]["0.95"].values())
    nmse, nlpd = f"{m['nmse']['total']:.3f} ({by_output})", f"{m['nlpd']['total']:.2f}"
    return " | ".join([nmse, low_high["nmse"], nlpd, low_high["nlpd"], exact, cover])


def difference(first: Comparison, second: Comparison) -> str:
    """The cells under HEAD for what the second model gains over the first on the same rows: differences, paired."""
    weights = push_bootstrap(first.push_id)
    spread = (first.observed - first.training_mean) ** 2
    errors = (second.observed - second.mean) ** 2 - (first.observed - first.mean) ** 2
    worse = _nlpd(second) - _nlpd(first)
    nmse = np.sum((weights @ errors) / (weights @ spread), axis=1)
    nlpd = (weights @ worse) / weights.sum(axis=1)
    values = float(np.sum(errors.sum(axis=0) / spread.sum(axis=0))), float(worse.mean())
    exact = "" if second.exact_log_density is None else f"{np.mean(_exact(second) - _nlpd(first)):+.2f}"
    return f"{values[0]:+.3f} | {_between(nmse, '+.3f')} | {values[1]:+.2f} | {_between(nlpd, '+.2f')} | {exact} |"


def total(comparison: Comparison, key: str) -> float:
    """One figure, summed over the outputs."""
    m: dict[str, Any] = metrics_json(comparison)
    return float(m[key]["total"])


def _nlpd(comparison: Comparison) -> Array:
    return np.asarray(gaussian_nlpd(comparison.mean, comparison.variance, comparison.observed).sum(axis=1))


def _exact(comparison: Comparison) -> Array:
    assert comparison.exact_log_density is not None
    return np.asarray(-comparison.exact_log_density.sum(axis=1))


def _between(draws: Array, form: str) -> str:
    low, high = np.quantile(draws, [0.025, 0.975])
    return f"{low:{form}} to {high:{form}}"
