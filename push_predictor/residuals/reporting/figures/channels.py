"""The data behind a finding that shifts no mean: the force, the gap at the contact, the noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.geometry.frames import wrap_angle
from push_predictor.recordings.table import PushTable
from push_predictor.reporting.canvas import COLOURS, SYMBOLS, grid
from push_predictor.residuals.evidence.standardised import push_order
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.partial import DRAWS, LEAST_PUSHES
from push_predictor.residuals.reporting.phrases import with_unit
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BINS = 10
NORMAL = "Direction of the contact normal in the world (deg)"


@dataclass(frozen=True, eq=False)
class Channel:
    """Values y (n, k) of windows against x (n,), with their names; spread: show the root mean square, not the mean."""

    x: Array
    label: str
    y: Array
    title: str
    names: tuple[str, ...]
    spread: bool = False


def channel_of(trace: Trace) -> Channel | None:
    """The data behind the verdict; None if these windows do not contain them."""
    table, effect = trace.analysis, trace.effects[0]
    covariates = table.covariates
    if trace.verdict == "variance" and len(trace.residual) == len(table):
        return Channel(
            *_driver(table, effect.covariate),
            trace.residual,
            "RMS residual / predicted standard deviation",
            SYMBOLS,
            True,
        )
    if trace.verdict == "wrench_only" and "normal_force" in covariates:
        place = _driver(table, effect.covariate)
        return Channel(*place, covariates["normal_force"][:, None], "Normal force (N)", ("normal force",))
    if trace.verdict == "measurement" and {"contact_gap", "push_heading"} <= set(covariates):
        gap = 1e3 * covariates["contact_gap"][:, None]
        return Channel(*_opening(table, effect.mechanism), gap, "Gap between pusher and outline (mm)", ("gap",))
    return None


def paint_channel(figure: Figure, table: PushTable, channel: Channel) -> None:
    """Paint bins of x with 95 % intervals from a bootstrap of pushes, and single windows where means are shown."""
    ax = figure.subplots()
    grid(ax)
    for k, name in enumerate(channel.names):
        y = channel.y[:, k]
        if not channel.spread:
            ax.plot(channel.x, y, ".", color="0.6", markersize=2.0, mew=0.0, zorder=1)
            ax.set_ylim(*_room(y))
        _paint_bins(ax, table, channel, y, COLOURS[k], name)
    ax.set(xlabel=channel.label, ylabel=channel.title)
    if len(channel.names) > 1:
        ax.axhline(1.0, color="0.2", linewidth=0.8, linestyle=":")
        ax.legend(loc="best")


def _paint_bins(ax: Axes, table: PushTable, channel: Channel, y: Array, colour: str, name: str) -> None:
    edges = np.unique(np.quantile(channel.x, np.linspace(0.0, 1.0, BINS + 1)[1:-1]))
    number = np.searchsorted(edges, channel.x, side="right")
    found = []
    for b in np.unique(number):
        rows = number == b
        if len(set(table.push_id[rows].tolist())) < LEAST_PUSHES:
            continue
        values = y[rows] ** 2 if channel.spread else y[rows]
        weights = push_bootstrap(table.push_id[rows], draws=DRAWS)
        low, high = np.quantile(weights @ values / weights.sum(axis=1), [0.025, 0.975])
        found.append([channel.x[rows].mean(), *(_shown(v, channel) for v in (values.mean(), low, high))])
    place, value, low, high = np.array(found).reshape(-1, 4).T
    ends = np.abs(np.stack([value - low, high - value]))
    ax.errorbar(place, value, ends, fmt="o-", color=colour, markersize=4.5, linewidth=1.0, capsize=2.0, label=name)


def _shown(value: float, channel: Channel) -> float:
    return float(np.sqrt(value)) if channel.spread else float(value)


def _room(y: Array) -> tuple[float, float]:
    low, high = np.quantile(y, [0.01, 0.99])
    margin = 0.1 * max(high - low, 1e-12)
    return float(low - margin), float(high + margin)


def _driver(table: PushTable, covariate: str) -> tuple[Array, str]:
    """The covariate, or the order of the pushes if it is not recorded."""
    if covariate not in table.covariates:
        return push_order(table).astype(np.float64), "Push count"
    return table.covariates[covariate], with_unit(covariate)


def _opening(table: PushTable, mechanism: str | None) -> tuple[Array, str]:
    """What a measurement error opens the gap with: a clock offset with the speed, a shift with the direction."""
    velocity, _, angle = table.inputs.T
    if mechanism == "clock_offset":
        return 1e3 * velocity * np.cos(angle), "Speed into the contact (mm/s)"
    return np.degrees(wrap_angle(table.covariates["push_heading"] - angle)), NORMAL
