"""Metrics as a person reads them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def metrics_lines(metrics: Mapping[str, Any]) -> list[str]:
    """Text lines: what was scored, a line for each output and the total, the intervals of the totals."""
    lines = [
        f"{metrics['model']}: {metrics['n_test']} windows of {metrics['n_pushes']} pushes, "
        f"trained on {metrics['n_train']} windows; NLPD in nats, SI units",
        f"{'':8s}{'NMSE':>9s}{'NLPD':>10s}{'exact':>10s}{'cov50':>8s}{'cov90':>8s}{'cov95':>8s}",
        *(_output_line(metrics, name) for name in ("dx", "dy", "dtheta", "total")),
    ]
    interval = metrics["interval"]
    if interval["nmse"] is not None:
        lines.append(f"95 % by push: NMSE {_range(interval['nmse'])}, NLPD {_range(interval['nlpd'])}")
    return lines


def _output_line(metrics: Mapping[str, Any], name: str) -> str:
    shares = [level and level.get(name) for level in metrics["coverage"].values()]
    exact = (metrics["exact_nlpd"] or {}).get(name)
    cells = [_cell(metrics["nmse"][name], 9), _cell(metrics["nlpd"][name], 10), _cell(exact, 10)]
    return f"{name:8s}" + "".join(cells + [_cell(share, 8) for share in shares])


def _cell(value: float | None, width: int) -> str:
    return f"{'-':>{width}s}" if value is None else f"{value:{width}.3f}"


def _range(interval: Mapping[str, float]) -> str:
    return f"{interval['low']:.3f} to {interval['high']:.3f}"
