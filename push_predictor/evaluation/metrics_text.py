# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Scores as text for a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from push_predictor.evaluation.metrics import nmse_reference

LEGEND = (
    "NMSE: 0 is perfect, 1 is no better than {reference}. The total is their sum, so 3 for {reference}.",
    "NLPD: nats per window in SI units, lower is better.",
    "exact NLPD: of the model's own predictive density; NLPD is of the Gaussian with the same moments.",
    "in 90 %: share of outcomes inside the predicted 90 % interval.",
)


def metrics_lines(metrics: Mapping[str, Any]) -> list[str]:
    """Lines of text: what was scored, a line per output and the total, intervals of the totals, how to read them."""
    levels = "".join(f"{f'in {100.0 * float(level):.0f} %':>9s}" for level in metrics["coverage"])
    lines = [
        f"{metrics['model']}: {metrics['n_test']} windows of {metrics['n_pushes']} pushes, "
        f"trained on {metrics['n_train']} windows",
        f"{'':8s}{'NMSE':>9s}{'NLPD':>10s}{'exact NLPD':>12s}{levels}",
        *(_output_line(metrics, name) for name in ("dx", "dy", "dtheta", "total")),
    ]
    interval = metrics["interval"]
    if interval["nmse"] is not None:
        lines.append(f"95 % intervals of the totals: NMSE {_range(interval['nmse'])}, NLPD {_range(interval['nlpd'])}")
    reference = nmse_reference(metrics["n_train"])
    return [*lines, *(line.format(reference=reference) for line in LEGEND)]


def _output_line(metrics: Mapping[str, Any], name: str) -> str:
    shares = [level and level.get(name) for level in metrics["coverage"].values()]
    exact = (metrics["exact_nlpd"] or {}).get(name)
    cells = [_cell(metrics["nmse"][name], 9), _cell(metrics["nlpd"][name], 10), _cell(exact, 12)]
    return f"{name:8s}" + "".join(cells + [_cell(share, 9) for share in shares])


def _cell(value: float | None, width: int) -> str:
    return f"{'-':>{width}s}" if value is None else f"{value:{width}.3f}"


def _range(interval: Mapping[str, float]) -> str:
    return f"{interval['low']:.3f} to {interval['high']:.3f}"
