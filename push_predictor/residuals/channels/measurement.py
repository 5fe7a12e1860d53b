# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The measurement channel: clock offsets, and rotations or shifts of the tracker's frame against the robot's.

While the pusher pushes, the gap between pusher and outline is zero; a measured gap is a measurement error. A shift s of
the slider's stream in the world opens the gap by -n.s (n: outward normal at the contact). A rotation e about the
world's origin opens it by -n.(e x contact point), and stamps that are late by d by -v cos(angle) d. A gap that depends
on the contact point alone is geometry (radius, outline, marker position). It is regressed out, as is the compliance of
the contact under its force.

The clock is judged on windows after a push's first: at first contact the slider is at rest, and a late stream still
shows it at rest. Later windows are valid under acceleration too; v is the speed at the window's start.

An error is corrected in the stream where it occurred, so that the windows can be cut again: the tracker's stream is
moved to the robot's frame and clock, a tool offset is subtracted from the pusher's stream, a bias from the wrench.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.geometry.frames import rotate, wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.channels.contrast import (
    ChannelEffect,
    ChannelFinding,
    Contrast,
    Stacked,
    best_and_rivals,
    block_diagonal,
    estimate_with_draws,
    inliers,
    is_identifiable,
    robust_deviation,
    screen_contrasts,
    sized,
    stacked,
)
from push_predictor.residuals.evidence.drivers import CONSTANT, SETTLED
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.split import FEWEST_PUSHES
from push_predictor.residuals.outcome import Tested
from push_predictor.types import Array, BoolArray, IntArray

NEEDED = ("contact_gap", "slider_x", "slider_y", "slider_heading")
PARAMETERS = {
    "clock_offset": (("lateness of the slider's stamps", "s"),),
    "frame_rotation": (("turn of the tracker's frame", "rad"),),
    "frame_shift": (("shift of the tracker's frame along x", "m"), ("shift of the tracker's frame along y", "m")),
}
ALIKE = {"frame_shift": ("tool_offset",)}  # equivalent to a tool offset of -s, as long as the tool does not rotate
MOST_EDGES = 8  # of an outline whose edges are treated separately; others count as smooth
CORNER = 0.002  # m; guards against a wrong normal: contacts closer to a corner may be on either side of it


@dataclass(frozen=True, eq=False)
class _Gap:
    """The gap z (n, 1) m with its controls (n, m), blocks of pushes (n,), contrasts, and which rows are new (n,)."""

    z: Array
    controls: Array
    block: IntArray
    tried: tuple[Contrast, ...]
    new: BoolArray

    def take(self, rows: BoolArray) -> _Gap:
        tried = tuple(each.take(rows) for each in self.tried)
        return _Gap(self.z[rows], self.controls[rows], self.block[rows], tried, self.new[rows])


def measurement_errors(
    windows: PushTable, baseline: PushTable | None, rig: Rig, alpha: float = 0.01, seed: int = 0
) -> ChannelFinding | None:
    """Measurement errors in new windows that the baseline (the model's training windows) does not have.

    None if the windows do not determine them: no contact_gap, no pose, or too few windows.
    """
    if any(name not in windows.covariates for name in NEEDED):
        return None
    base = None if baseline is None else _off_corners(baseline, rig.outline)
    both = stacked(_off_corners(windows, rig.outline), base, NEEDED)
    gap = _gap_of(both, rig.outline)
    if len(both.tables[-1].pushes) < FEWEST_PUSHES or not gap.tried:
        return None
    gap = gap.take(inliers(gap.z, np.concatenate([each.columns for each in gap.tried], axis=2), gap.controls))
    return _searched(gap, alpha, seed)


def gap_responses(table: PushTable, outline: Outline) -> dict[str, Array]:
    """Change of the gap (n, p) m per unit of each mechanism's parameters: s, rad, m along the world's x and y."""
    velocity, contact, angle = table.inputs.T
    heading = table.covariates["slider_heading"]
    outward = -rotate(outline.inward_normal(contact), heading)
    place = np.column_stack([table.covariates["slider_x"], table.covariates["slider_y"]])
    touch = place + rotate(outline.point(contact), heading)
    turned = np.column_stack([-touch[:, 1], touch[:, 0]])
    return {
        "clock_offset": (-velocity * np.cos(angle) * _settled(table))[:, None],
        "frame_rotation": -np.sum(outward * turned, axis=1)[:, None],
        "frame_shift": -outward,
    }


def _gap_of(both: Stacked, outline: Outline) -> _Gap:
    controls = block_diagonal([_geometry(table, outline) for table in both.tables])
    responses = [gap_responses(table, outline) for table in both.tables]
    stack = {name: both.joined([r[name] for r in responses]) for name in PARAMETERS}
    if len(both.tables) > 1:
        controls = np.column_stack([controls, *stack.values()])
    nothing = np.zeros((len(both.new), 0))
    tried = [
        Contrast(name, CONSTANT, DriverBasis("constant"), (column * both.new[:, None])[:, None, :], nothing)
        for name, column in stack.items()
    ]
    z = both.joined([table.covariates["contact_gap"] for table in both.tables])[:, None]
    return _Gap(z, controls, both.block, tuple(each for each in tried if is_identifiable(each, controls)), both.new)


def _geometry(table: PushTable, outline: Outline) -> Array:
    """Controls of the gap (n, m): a function of the contact point, compliance, transient of the first window."""
    shape = _edges(table.inputs[:, 1], outline) if len(outline.vertices) <= MOST_EDGES else _around(table.inputs[:, 1])
    first = 1.0 - _settled(table)
    columns = [shape, first, first * table.inputs[:, 0], first * table.inputs[:, 0] * np.cos(table.inputs[:, 2])]
    if "normal_force" in table.covariates:
        columns.append(table.covariates["normal_force"])
    return np.column_stack(columns)


def _off_corners(table: PushTable, outline: Outline) -> PushTable:
    """Windows that are not close to a corner, where the normal is ambiguous."""
    if len(outline.vertices) > MOST_EDGES:
        return table
    edge, fraction = outline.edge(table.inputs[:, 1])
    length = np.diff(outline.edge_starts)[edge] * outline.perimeter
    return table.take(np.minimum(fraction, 1.0 - fraction) * length >= CORNER)


def _edges(contact: Array, outline: Outline) -> Array:
    edge, fraction = outline.edge(contact)
    on = (edge[:, None] == np.unique(edge)).astype(np.float64)
    return np.column_stack([on, on * fraction[:, None]])


def _around(contact: Array) -> Array:
    turn = 2.0 * np.pi * contact
    return np.column_stack([np.ones_like(turn), *(f(k * turn) for k in (1, 2, 3) for f in (np.cos, np.sin))])


def _settled(table: PushTable) -> Array:
    since = table.covariates.get("time_since_contact")
    return np.ones(len(table)) if since is None else (since >= SETTLED).astype(np.float64)


def _searched(gap: _Gap, alpha: float, seed: int) -> ChannelFinding:
    """Select errors one by one, strongest first, each with those before it regressed out."""
    controls, remaining = gap.controls, list(gap.tried)
    found: list[tuple[Contrast, float, tuple[str, ...]]] = []
    tested: tuple[Tested, ...] = ()
    while remaining:
        p_values = screen_contrasts(gap.z, remaining, controls, gap.block, seed).p_value.tolist()
        tested = tested or tuple(Tested(t.mechanism, CONSTANT, p) for t, p in zip(remaining, p_values, strict=True))
        significant = {t.mechanism: p for t, p in zip(remaining, p_values, strict=True) if p <= alpha}
        if not significant:
            break
        alike = best_and_rivals(gap.z, [t for t in remaining if t.mechanism in significant], controls, gap.block, seed)
        best = alike[0]
        found.append((best, significant[best.mechanism], _names(alike)))
        controls = np.column_stack([controls, best.columns[:, 0]])
        remaining = [t for t in remaining if t is not best and is_identifiable(t, controls)]
    return ChannelFinding(_sized(gap, found, controls, seed) if found else (), tested)


def _names(alike: Sequence[Contrast]) -> tuple[str, ...]:
    names = [t.mechanism for t in alike]
    return tuple(name for each in names for name in (each, *ALIKE.get(each, ())) if name != names[0])


def _sized(
    gap: _Gap, found: Sequence[tuple[Contrast, float, tuple[str, ...]]], controls: Array, seed: int
) -> tuple[ChannelEffect, ...]:
    """Joint estimates of all errors; those with a smaller effect than the noise of a single window are dropped."""
    noise = robust_deviation(Residualizer(controls)(gap.z)[:, 0])
    nothing, columns = np.zeros((len(gap.z), 0)), np.concatenate([each.columns for each, _, _ in found], axis=2)
    values, draws = estimate_with_draws(gap.z, columns, gap.controls, nothing, gap.block, seed)
    errors, begin = [], 0
    for each, p_value, rivals in found:
        part = slice(begin, begin := begin + each.columns.shape[2])
        if np.sqrt(np.mean((each.columns[gap.new, 0] @ values[part]) ** 2)) >= noise:
            parameters = sized(PARAMETERS[each.mechanism], values[part], draws[:, part])
            errors.append(ChannelEffect(each.mechanism, CONSTANT, "constant", parameters, p_value, rivals))
    return tuple(errors)


# --- correction ------------------------------------------------------------------------------------------------------


def correct(recording: Recording, mechanism: str, values: Sequence[float]) -> Recording:
    """The recording without a measurement error; values: its parameters, as in ChannelEffect.values.

    clock_offset (s): the slider's stamps are late. frame_rotation (rad): the slider appears rotated about the world's
    origin. frame_shift (m, m): the slider appears shifted. tool_offset (m, m): the pusher appears shifted. wrench_bias
    (N, N): the sensor reads too much, in world axes. Raises KeyError for another mechanism.
    """
    corrected = CORRECTIONS[mechanism](recording, *values)
    sizes = ", ".join(f"{value:.3g}" for value in values)
    return replace(corrected, notes=(*recording.notes, f"corrected for {mechanism} ({sizes})"))


def _clock(recording: Recording, lateness: float) -> Recording:
    slider = recording.slider
    return replace(recording, slider=replace(slider, stamp=slider.stamp - round(lateness * 1e9)))


def _rotation(recording: Recording, turn: float) -> Recording:
    slider = recording.slider
    place = rotate(np.column_stack([slider.x, slider.y]), np.array(-turn))
    heading = wrap_angle(slider.heading - turn)
    return replace(recording, slider=replace(slider, x=place[:, 0], y=place[:, 1], heading=heading))


def _shift(recording: Recording, x: float, y: float) -> Recording:
    return replace(recording, slider=_moved(recording.slider, -x, -y))


def _tool(recording: Recording, x: float, y: float) -> Recording:
    return replace(recording, pusher=_moved(recording.pusher, -x, -y))


def _bias(recording: Recording, x: float, y: float) -> Recording:
    wrench = recording.wrench
    if wrench is None:
        return recording
    return replace(recording, wrench=replace(wrench, fx=wrench.fx - x, fy=wrench.fy - y))


def _moved(stream: PoseStream, x: float, y: float) -> PoseStream:
    return replace(stream, x=stream.x + x, y=stream.y + y)


CORRECTIONS: dict[str, Callable[..., Recording]] = {
    "clock_offset": _clock,
    "frame_rotation": _rotation,
    "frame_shift": _shift,
    "tool_offset": _tool,
    "wrench_bias": _bias,
}
