# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Findings on the outline's pose, size and shape, on the tip's radius, the frames and the clocks, from the fits."""

from __future__ import annotations

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.outline.causes import (
    DOUBT,
    LAG_ALLOWANCE,
    LENGTH_ALLOWANCE,
    Cause,
    cause_of,
    half_size,
    is_resized,
    is_shifted,
    is_turned,
)
from push_predictor.recordings.checks.outline.fit import TIE, OutlineFit, fit_outline, fit_tip
from push_predictor.recordings.checks.outline.touches import (
    FRAME_X,
    FRAME_Y,
    FRAME_YAW,
    LAG,
    SIZE,
    STRETCH,
    TIP,
    YAW,
    Contacts,
    X,
    Y,
)
from push_predictor.recordings.rig import Rig
from push_predictor.types import Array

FEWEST_PUSHES = 8  # for five parameters: with fewer, the spread between pushes gives no standard deviation
SHARE_OFF = 0.05  # of the pushes: if more lie off the corrected outline, its shape is wrong
NOISY = 3.0 * 1.48  # three standard deviations of the pushes, in median absolute gaps
ONE_PUSH_OFF = 2.0 * LENGTH_ALLOWANCE  # m; a single push may be disturbed by more than the allowance
UNSEPARATED = "these contacts do not separate the two"


def outline_findings(contacts: Contacts, rig: Rig, fit: OutlineFit) -> list[Finding]:
    """What a fit of the rig's outline to the contacts shows. Lengths in m, angles in rad, times in s."""
    if fit.pushes < FEWEST_PUSHES:
        return [unchecked(fit.pushes)]
    cause = cause_of(contacts, rig, fit)
    found = [_frames_apart(cause.fit)] if cause.name == "frames_apart" else []
    found += _pose_findings(cause.fit, rig)
    if cause.name == "proportions":
        found.append(_proportions(cause.fit, rig))
    elif is_resized(cause.fit, rig):
        found.append(_size(contacts, rig, cause))
    if cause.name == "tip_radius":
        found.append(_tip(cause, rig))
    return [*found, *_clock_findings(cause.fit), *_shape_findings(cause.fit, rig)]


def fit_rig(contacts: Contacts, rig: Rig) -> OutlineFit:
    """The correction of the rig's outline that fits the contacts."""
    return fit_outline(rig.outline, rig.pusher_radius, contacts)


def value_of(fit: OutlineFit, parameter: int, unit: str, offset: float = 0.0) -> Value:
    """A fitted parameter, plus an offset, with its standard deviation."""
    return Value(float(fit.estimate[parameter]) + offset, unit, float(fit.sd[parameter]))


def unchecked(pushes: int) -> Finding:
    """The finding that there are too few pushes to estimate the outline from."""
    count = "push was" if pushes == 1 else "pushes were"
    sentence = f"Only {pushes} {count} recorded: yaw, shift and size of the outline cannot be estimated."
    advice = f"Record at least {FEWEST_PUSHES} pushes, on all sides."
    return Finding("outline_unchecked", "note", sentence, advice, {"pushes": Value(pushes, "1")})


def _pose_findings(fit: OutlineFit, rig: Rig) -> list[Finding]:
    found = [_turned(value_of(fit, YAW, "rad"))] if is_turned(fit) else []
    if is_shifted(fit):
        found.append(_shifted(value_of(fit, X, "m"), value_of(fit, Y, "m"), rig, one_side=fit.sd[SIZE] == 0.0))
    return found


def _turned(yaw: Value) -> Finding:
    degrees, sd = np.degrees(yaw.value), np.degrees(yaw.sd or 0.0)
    sentence = f"The slider is turned by {degrees:.1f} degrees (sd {sd:.1g}) against its outline."
    advice = f"Turn the outline in the rig by {degrees:.1f} degrees: `check --rig-out` writes that rig."
    return Finding("outline_turned", "warning", sentence, advice, {"yaw": yaw})


def _shifted(x: Value, y: Value, rig: Rig, one_side: bool) -> Finding:
    given = 1e3 * rig.outline.centroid
    centre = np.round(given + 1e3 * np.array([x.value, y.value]), 1) + 0.0  # without a negative zero
    origin = f"({given[0]:.1f}, {given[1]:.1f}) mm" if np.any(np.abs(given) > 0.05) else "its origin"
    sentence = (
        f"The slider's centre is at ({centre[0]:.1f}, {centre[1]:.1f}) mm in the tracked frame "
        f"(sd {1e3 * (x.sd or 0.0):.1g}, {1e3 * (y.sd or 0.0):.1g}), not at {origin}."
    )
    advice = "Move the tracked frame's origin there, or the outline in the rig (`check --rig-out` writes that rig)."
    if one_side:
        advice += " Or the size is wrong: push other sides too, to separate the two."
    return Finding("outline_shifted", "warning", sentence, advice, {"x": x, "y": y})


def _size(contacts: Contacts, rig: Rig, cause: Cause) -> Finding:
    """The size if the tip's radius is right, and the radius if the size is right where the contacts fit both."""
    scale = value_of(cause.fit, SIZE, "1", 1.0)
    sentence = (
        f"The slider is {scale.value:.3f} times as large as its outline (sd {scale.sd or 0.0:.1g}), "
        f"{1e3 * (scale.value - 1.0) * half_size(rig):.1f} mm a side"
    )
    advice = f"Multiply the outline by {scale.value:.3f}"
    values = {"scale": scale}
    if cause.name != "tip_radius":
        tip = fit_tip(rig.outline, rig.pusher_radius, contacts, cause.fit)
        if tip.cost <= TIE * cause.fit.cost:
            radius = value_of(tip, TIP, "m", rig.pusher_radius)
            values["radius_if_size_is_right"] = radius
            sentence += f", if the tip's radius is right. If the sizes are right, {_radius(radius, rig)}"
            more = 1e3 * float(tip.estimate[TIP])
            advice += f", or correct the tip radius by {more:.1f} mm: {UNSEPARATED}. Measure both again"
    return Finding("outline_size", "warning", f"{sentence}.", f"{advice}.", values)


def _tip(cause: Cause, rig: Rig) -> Finding:
    radius = value_of(cause.fit, TIP, "m", rig.pusher_radius)
    sentence, advice = _radius(radius, rig), "Correct pusher_radius in the rig"
    if cause.rival is not None:
        advice += f", or, if it is right, the sizes: {_sizes(cause.rival, rig)[0]}. {UNSEPARATED.capitalize()}"
    return Finding("tip_radius", "warning", f"{sentence[0].upper()}{sentence[1:]}.", f"{advice}.", {"radius": radius})


def _radius(radius: Value, rig: Rig) -> str:
    stated = f"{1e3 * rig.pusher_radius:.2f} mm in the rig"
    return f"the tip's radius is {1e3 * radius.value:.2f} mm (sd {1e3 * (radius.sd or 0.0):.2f}), {stated}"


def _proportions(fit: OutlineFit, rig: Rig) -> Finding:
    text, lengths = _sizes(fit, rig)
    given = 1e3 * _extent(rig)
    sentence = f"The outline's shape is wrong. The slider is {text}, not {given[0]:.1f} x {given[1]:.1f} mm."
    advice = "Measure both sizes of the slider again, and write a new rig."
    names = ("length_x", "length_y")
    return Finding("outline_shape", "warning", sentence, advice, dict(zip(names, lengths, strict=True)))


def _sizes(fit: OutlineFit, rig: Rig) -> tuple[str, tuple[Value, Value]]:
    """The lengths along the outline's own axes, in words and numbers."""
    growth, stretch = 1.0 + float(fit.estimate[SIZE]), float(fit.estimate[STRETCH])
    sd = float(np.hypot(fit.sd[SIZE], fit.sd[STRETCH] / 2.0))
    x, y = (
        Value(float(length * growth * factor), "m", float(length * sd))
        for length, factor in zip(_extent(rig), (1.0 + stretch / 2.0, 1.0 - stretch / 2.0), strict=True)
    )
    return f"{1e3 * x.value:.1f} x {1e3 * y.value:.1f} mm (sd {1e3 * (x.sd or 0.0):.1g})", (x, y)


def _extent(rig: Rig) -> Array:
    """Lengths (2,) m of an ellipse or a rectangle along its own axes."""
    outline = rig.outline
    return 2.0 * np.array(outline.semi_axes) if outline.semi_axes is not None else np.ptp(outline.vertices, axis=0)


def _shape_findings(fit: OutlineFit, rig: Rig) -> list[Finding]:
    """Whether pushes lie off the corrected outline, and on which side most do."""
    usual = NOISY * float(np.median(np.abs(fit.push_gaps))) if fit.spread < LENGTH_ALLOWANCE else 0.0
    limit = max(LENGTH_ALLOWANCE, usual)
    off = fit.off(rig.outline, limit)
    if np.mean(off) <= SHARE_OFF or (np.count_nonzero(off) == 1 and not fit.off(rig.outline, ONE_PUSH_OFF).any()):
        return []
    largest = int(np.argmax(np.where(off, np.abs(fit.push_gaps), 0.0)))
    gap, edge = float(fit.push_gaps[largest]), int(rig.outline.edge(fit.push_contacts[largest : largest + 1])[0][0])
    place = f"on side {edge + 1}" if rig.outline.semi_axes is None else f"at contact {fit.push_contacts[largest]:.2f}"
    sentence = (
        f"The outline's shape is wrong: no turn, shift or size explains the contacts. After the correction, "
        f"{np.count_nonzero(off)} of {fit.pushes} pushes touch over {1e3 * limit:.1f} mm off it, at "
        f"most {1e3 * abs(gap):.1f} mm {'outside' if gap > 0.0 else 'inside'}, {place}."
    )
    advice = "Measure the outline there again. If only single pushes are off, their poses may be disturbed."
    values = {"residual": Value(gap, "m"), "share_off": Value(float(np.mean(off)), "1")}
    return [Finding("outline_shape", "warning", sentence, advice, values)]


def _frames_apart(fit: OutlineFit) -> Finding:
    """The pose of the pusher's world frame in the slider's: p' = turn(p) + shift."""
    yaw = value_of(fit, FRAME_YAW, "rad")
    shift = fit.centre + fit.estimate[[FRAME_X, FRAME_Y]] - rotate(fit.centre, np.array(yaw.value))
    sd = np.hypot(fit.sd[[FRAME_X, FRAME_Y]], np.abs(fit.centre[::-1]) * fit.sd[FRAME_YAW])
    degrees, (x, y) = np.degrees(yaw.value), np.round(1e3 * shift, 1) + 0.0
    sentence = (
        f"The world frames of slider and pusher are apart: the pusher's is turned by {degrees:.1f} degrees (sd "
        f"{np.degrees(yaw.sd or 0.0):.1g}) and shifted by ({x:.1f}, {y:.1f}) mm (sd {1e3 * sd[0]:.1g}, "
        f"{1e3 * sd[1]:.1g}) in the slider's."
    )
    advice = (
        f"Calibrate tracker and robot again, or turn the pusher's positions by {degrees:.1f} degrees about the world "
        f"origin and add ({x:.1f}, {y:.1f}) mm."
    )
    frame = {f"frame_{name}": Value(float(s), "m", float(d)) for name, s, d in zip("xy", shift, sd, strict=True)}
    return Finding("frames_apart", "warning", sentence, advice, {"frame_yaw": yaw, **frame})


def _clock_findings(fit: OutlineFit) -> list[Finding]:
    lag, sd = float(fit.estimate[LAG]), float(fit.sd[LAG])
    if abs(lag) <= DOUBT * sd + LAG_ALLOWANCE:
        return []
    side = "late" if lag > 0.0 else "early"
    sentence = f"The slider's stamps are {1e3 * abs(lag):.0f} ms {side} (sd {1e3 * sd:.2g} ms) against the pusher's."
    advice = "Synchronise the clocks (chrony, PTP), or correct the stamps."
    return [Finding("clocks_apart", "warning", sentence, advice, {"lag": Value(lag, "s", sd)})]
