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
Clocks that `check` found off are not corrected.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag
from scipy.special import ndtri
from scipy.stats import norm

from push_predictor.geometry.frames import rotate, wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.channels.contrast import (
    ChannelEffect,
    ChannelFinding,
    Chosen,
    Contrast,
    Quantity,
    Stacked,
    inliers,
    robust_deviation,
    searched,
    sized,
    sizes,
    stacked,
)
from push_predictor.residuals.evidence.drivers import CONSTANT, at_touch
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.standardised import FEWEST_PUSHES
from push_predictor.residuals.outcome import Sized
from push_predictor.types import Array

NEEDED = ("contact_gap", "slider_x", "slider_y", "slider_heading")
PARAMETERS = {
    "clock_offset": (("lateness of the slider's stamps", "s"),),
    "frame_rotation": (("turn of the tracker's frame", "rad"),),
    "frame_shift": (("shift of the tracker's frame along x", "m"), ("shift of the tracker's frame along y", "m")),
}
ALIKE = {"frame_shift": ("tool_offset",)}  # equivalent to a tool offset of -s, as long as the tool does not rotate
MOST_EDGES = 8  # of an outline whose edges are treated separately; others count as smooth
CORNER = 0.002  # m; guards against a wrong normal: contacts closer to a corner may be on either side of it
CLOCKS = {  # findings of check about clocks
    "clocks_apart": "lateness of the slider's stamps",
    "clock_step": "step of the slider's stamps",
    "clock_drift": "drift of the slider's stamps",
    "wrench_lag": "lateness of the force's stamps",
}
UNTRUSTED = "A clock that is off changes windows and forces: effects on them are not trusted, and no model is extended."


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
    chosen, tested, _ = searched(gap, alpha, seed)
    return ChannelFinding(_sized(gap, chosen, seed), tested)


def gap_responses(table: PushTable, outline: Outline) -> dict[str, Array]:
    """Change of the gap (n, p) m per unit of each mechanism's parameters: s, rad, m along the world's x and y."""
    velocity, contact, angle = table.inputs.T
    heading = table.covariates["slider_heading"]
    outward = -rotate(outline.inward_normal(contact), heading)
    place = np.column_stack([table.covariates["slider_x"], table.covariates["slider_y"]])
    touch = place + rotate(outline.point(contact), heading)
    turned = np.column_stack([-touch[:, 1], touch[:, 0]])
    return {
        "clock_offset": (-velocity * np.cos(angle) * (1.0 - at_touch(table)))[:, None],
        "frame_rotation": -np.sum(outward * turned, axis=1)[:, None],
        "frame_shift": -outward,
    }


def clock_errors(findings: Sequence[Finding]) -> tuple[ChannelEffect, ...]:
    """The clocks that `check` found off, as measurement errors with their sizes."""
    return tuple(map(_error, findings))


def clock_notes(findings: Sequence[Finding]) -> tuple[str, ...]:
    """What was found about clocks, and that nothing is learnt from it."""
    return (*(finding.text for finding in findings), UNTRUSTED) if findings else ()


def _gap_of(both: Stacked, outline: Outline) -> Quantity:
    """The gap (n, 1) m; what geometry and errors do to it in training is a control."""
    controls = block_diag(*(_geometry(table, outline) for table in both.tables))
    responses = [gap_responses(table, outline) for table in both.tables]
    stack = {name: np.concatenate([r[name] for r in responses]) for name in PARAMETERS}
    if len(both.tables) > 1:
        controls = np.column_stack([controls, *stack.values()])
    nothing, on = np.zeros((len(both.new), 0)), np.ones(1)
    tried = [
        Contrast(name, CONSTANT, DriverBasis("constant"), column * both.new[:, None], nothing, on)
        for name, column in stack.items()
    ]
    z = np.concatenate([table.covariates["contact_gap"] for table in both.tables])[:, None]
    columns = np.concatenate([each.columns for each in tried], axis=2)
    return Quantity.of(z, controls, both, tried, inliers(z, columns, controls))


def _geometry(table: PushTable, outline: Outline) -> Array:
    """Controls of the gap (n, m): a function of the contact point, compliance, transient of the first window."""
    shape = _edges(table.inputs[:, 1], outline) if len(outline.vertices) <= MOST_EDGES else _around(table.inputs[:, 1])
    first = at_touch(table)
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


def _sized(gap: Quantity, chosen: Sequence[Chosen], seed: int) -> tuple[ChannelEffect, ...]:
    """The errors; those with a smaller effect than the noise of a single window are dropped."""
    controls = np.column_stack([gap.controls, *(each.contrast.values for each in chosen)])
    noise = robust_deviation(Residualizer(controls)(gap.z)[:, 0])
    errors = []
    for each, (values, draws) in zip(chosen, sizes(gap, chosen, seed), strict=True):
        name, shift = str(each.contrast.mechanism), each.contrast.values[gap.stack.new[gap.rows]] @ values
        if np.sqrt(np.mean(shift**2)) >= noise:
            rivals = (*ALIKE.get(name, ()), *(one for r in each.rivals for one in (r, *ALIKE.get(r, ()))))
            parameters = sized(PARAMETERS[name], values, draws)
            errors.append(ChannelEffect(name, CONSTANT, "constant", parameters, each.p_value, rivals))
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


def _moved(stream: PoseStream, x: float, y: float) -> PoseStream:
    return replace(stream, x=stream.x - x, y=stream.y - y)


def _bias(recording: Recording, x: float, y: float) -> Recording:
    wrench = recording.wrench
    if wrench is None:
        return recording
    return replace(recording, wrench=replace(wrench, fx=wrench.fx - x, fy=wrench.fy - y))


CORRECTIONS: dict[str, Callable[..., Recording]] = {
    "clock_offset": _clock,
    "frame_rotation": _rotation,
    "frame_shift": lambda recording, x, y: replace(recording, slider=_moved(recording.slider, x, y)),
    "tool_offset": lambda recording, x, y: replace(recording, pusher=_moved(recording.pusher, x, y)),
    "wrench_bias": _bias,
}


def _error(finding: Finding) -> ChannelEffect:
    size = next(iter(finding.values.values()), Value(0.0, "s"))
    half = float(ndtri(0.975)) * (size.sd or 0.0)
    sized = Sized(CLOCKS[finding.name], size.value, size.value - half, size.value + half, size.unit)
    p_value = 2.0 * float(norm.sf(abs(size.value) / size.sd)) if size.sd else 0.0
    return ChannelEffect("clock_offset", CONSTANT, "constant", (sized,), p_value)
