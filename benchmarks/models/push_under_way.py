# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the earlier windows of a push tell about its next one: docs/results/intervals.md.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.models.push_under_way --data FOLDER [--earlier K] [--sizes N ...]
        [--means ...]

Every held-out window but the first of each push is predicted alone and given up to K windows before it. The
density is the model's own. Intervals resample whole pushes.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.measured.informed import Case, measured_cases, trained
from push_predictor.evaluation.estimate import difference_by_push, total_exact_nlpd, total_nmse
from push_predictor.evaluation.push_scores import PushScores, pooled, push_scores
from push_predictor.evaluation.validation import Comparison
from push_predictor.models.prediction import Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.planning.given_earlier import EarlierWindows, given_earlier
from push_predictor.planning.persistence import persistence_of
from push_predictor.recordings.table import PushTable
from push_predictor.types import IntArray

NEAREST = 1e-6  # m, between the starts of two windows
HEAD = (
    "| n | mean | windows | 95 % alone: dx dy dtheta | 95 % given earlier | NMSE, difference | exact NLPD, difference |"
)


@dataclass(frozen=True, eq=False)
class Row:
    """A window and those before it in its push, as rows of a table."""

    own: int
    before: IntArray


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="the folder of the measured data")
    parser.add_argument("--earlier", type=int, default=5, metavar="K", help="windows (default %(default)s)")
    parser.add_argument("--sizes", nargs="+", type=int, default=(200, 1000))
    parser.add_argument("--means", nargs="+", default=("mechanics", "zero"))
    options = parser.parse_args(arguments)
    print(f"{HEAD}\n{7 * '|---'}|")
    for _, cases in measured_cases(options.data):
        for n in options.sizes:
            for mean in options.means:
                print_row(cases, n, mean, options.earlier)


def print_row(cases: Sequence[Case], n: int, mean: str, earlier: int) -> None:
    """Print the row of a size and mean."""
    pairs = [compared(trained(case, n, "vhgp", mean, tails=True)[0], case.test, earlier) for case in cases]
    alone, given = (pooled([push_scores(pair[k]) for pair in pairs]) for k in (0, 1))
    windows = sum(len(pair[0].observed) for pair in pairs)
    change = [difference_by_push(alone, given, figure) for figure in (total_nmse, total_exact_nlpd)]
    cells = [_within(alone), _within(given), change[0].text("+.3f"), change[1].text("+.3f")]
    print(f"| {n} | {mean} | {windows} | {' | '.join(cells)} |", flush=True)


def compared(model: PushModel, table: PushTable, earlier: int) -> tuple[Comparison, Comparison]:
    """Predictions of all windows that have an earlier one in their push: alone, and given the earlier ones."""
    prediction, persistence = model.predict_rows(table.inputs, table.duration, table.covariates), persistence_of(model)
    rows, found = _rows(table, earlier), []
    for row in rows:
        before = EarlierWindows(_taken(prediction, row.before), table.outcomes[row.before], _distance(table, row))
        found.append(given_earlier(_taken(prediction, np.array([row.own])), before, persistence))
    own = np.array([row.own for row in rows])
    given = replace(
        prediction,
        mean=np.concatenate([one.mean for one in found]),
        covariance=np.concatenate([one.covariance for one in found]),
    )
    return _comparison(model, table, own, _taken(prediction, own)), _comparison(model, table, own, given)


def _comparison(model: PushModel, table: PushTable, own: IntArray, prediction: Prediction) -> Comparison:
    tails, observed = model.predictor.tails, table.outcomes[own]
    assert tails is not None
    density = tails.log_density((observed - prediction.mean) / prediction.std) - np.log(prediction.std)
    return Comparison(
        model.name,
        len(model.training),
        table.push_id[own],
        prediction.mean,
        prediction.covariance,
        observed,
        density,
        model.training_mean,
        tails,
    )


def _rows(table: PushTable, earlier: int) -> list[Row]:
    rows = []
    for push in table.pushes:
        own = np.flatnonzero(table.push_id == push)
        own = own[np.argsort(table.covariates.get("elapsed_time", np.arange(len(table)))[own], kind="stable")]
        rows += [Row(int(own[k]), own[max(0, k - earlier) : k]) for k in range(1, len(own))]
    return rows


def _distance(table: PushTable, row: Row) -> np.ndarray:
    """Along the tip's path, by the recorded time; windows without it are contiguous."""
    speed = table.inputs[row.own, 0]
    if "elapsed_time" in table.covariates:
        time = table.covariates["elapsed_time"]
        return np.asarray(np.maximum(speed * (time[row.own] - time[row.before]), NEAREST))
    return np.asarray(speed * table.duration[row.own] * np.arange(len(row.before), 0, -1))


def _taken(prediction: Prediction, rows: IntArray) -> Prediction:
    return replace(
        prediction,
        mean=prediction.mean[rows],
        covariance=prediction.covariance[rows],
        process_covariance=prediction.process_covariance[rows],
        in_domain=prediction.in_domain[rows],
    )


def _within(scores: PushScores) -> str:
    return " ".join(f"{share:.3f}" for share in scores.totals().coverage[0, :, -1])


if __name__ == "__main__":
    main()
