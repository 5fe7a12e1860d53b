# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Findings on the outline's pose, size and shape, on the tip's radius, the frames and the clocks, from the fits.

A corrected outline alone may explain the contacts, or a wrong tip, world frames apart, or other proportions. Each of
these causes is a further parameter of the fit, named only where it explains clearly more, by a plausible amount.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.outline_fit import (
    DOUBT,
    FRAME_X,
    FRAME_Y,
    FRAME_YAW,
    FRAMES,
    LAG,
    LAG_ALLOWANCE,
    LENGTH_ALLOWANCE,
    SCALE,
    SIZE,
    STRETCH,
    TIE,
    TIP,
    TOOL,
    YAW,
    Contacts,
    OutlineFit,
    X,
    Y,
    half_size,
    refit,
)
from push_predictor.recordings.rig import Rig
from push_predictor.types import Array

Name: TypeAlias = Literal["outline", "tip_radius", "frames_apart", "tip_offset", "proportions"]
# What may be wrong besides the outline's pose and size, by the parameters that it adds; the first of equally good ones.
FURTHER: dict[Name, tuple[int, ...]] = {"frames_apart": FRAMES, "tip_offset": TOOL, "proportions": (STRETCH,)}
SEPARATE = 0.0002  # m; sd of size and tip radius, fitted together, above which the contacts do not separate them
FINE = 0.0001  # m; a spread of the pushes below it leaves nothing to explain
LARGEST_TIP_CHANGE = 0.55  # relative; a diameter given as the radius is a change of 0.5
LARGEST_SIZE_CHANGE = 0.1  # relative
LEAST_TURN = np.radians(20.0)  # of a tool, from which on its axes are others than the world's
RIGHT_ANGLE = 1e-6  # cosine
FEWEST_PUSHES = 8  # for five parameters: with fewer, the spread between pushes gives no standard deviation
SHARE_OFF = 0.05  # of the pushes: if more lie off the corrected outline, its shape is wrong
NOISY = 3.0 * 1.48  # three standard deviations of the pushes, in median absolute gaps
ONE_PUSH_OFF = 2.0 * LENGTH_ALLOWANCE  # m; a single push may be disturbed by more than the allowance
TIP_POSE = "give the pose of the tip (`--pusher-topic`, of a frame of tf `--pusher-topic /tf:TIP`), not of the flange."
UNSEPARATED = "these contacts do not separate the two"


def outline_findings(contacts: Contacts, rig: Rig, fit: OutlineFit) -> list[Finding]:
    """What a fit of the rig's outline to the contacts shows. Lengths in m, angles in rad, times in s."""
    if fit.pushes < FEWEST_PUSHES:
        return [unchecked(fit.pushes)]
    cause = cause_of(contacts, rig, fit)
    found = [_frames_apart(cause.fit)] if cause.name == "frames_apart" else []
    if cause.name == "tip_offset":
        found.append(_tip_offset(cause.fit))
    if cause.fit.shows(YAW):
        found.append(_turned(cause.fit.value(YAW, "rad")))
    if cause.fit.shows(X, Y) and _shift_explains(contacts, rig, cause):
        found.append(_shifted(cause.fit, rig))
    if cause.name == "proportions":
        found.append(_proportions(cause.fit, rig))
    elif cause.fit.shows(SIZE):
        found.append(_size(contacts, rig, cause))
    if cause.name == "tip_radius":
        found.append(_tip(cause, rig))
    lag = cause.fit.value(LAG, "s", contacts.lag)
    if abs(lag.value) > DOUBT * (lag.sd or 0.0) + LAG_ALLOWANCE:
        found.append(clocks_apart(lag))
    return [*found, *_shape_findings(cause.fit, rig)]


def unchecked(pushes: int) -> Finding:
    """The finding that there are too few pushes to estimate the outline from."""
    count = "push was" if pushes == 1 else "pushes were"
    sentence = f"Only {pushes} {count} recorded: yaw, shift and size of the outline cannot be estimated."
    advice = f"Record at least {FEWEST_PUSHES} pushes, on all sides."
    return Finding("outline_unchecked", "note", sentence, advice, {"pushes": Value(pushes, "1")})


def _turned(yaw: Value) -> Finding:
    degrees, sd = np.degrees(yaw.value), np.degrees(yaw.sd or 0.0)
    sentence = f"The slider is turned by {degrees:.1f} degrees (sd {sd:.1g}) against its outline."
    advice = f"Turn the outline in the rig by {degrees:.1f} degrees: `rig --from` writes that rig."
    return Finding("outline_turned", "warning", sentence, advice, {"yaw": yaw})


def _shifted(fit: OutlineFit, rig: Rig) -> Finding:
    x, y, given = fit.value(X, "m"), fit.value(Y, "m"), 1e3 * rig.outline.centroid
    centre = np.round(given + 1e3 * np.array([x.value, y.value]), 1) + 0.0  # without a negative zero
    sentence = (
        f"The slider's centre is at ({centre[0]:.1f}, {centre[1]:.1f}) mm in the tracked frame "
        f"(sd {1e3 * (x.sd or 0.0):.1g}, {1e3 * (y.sd or 0.0):.1g}), not at ({given[0]:.1f}, {given[1]:.1f})."
    )
    advice = "Move the tracked frame's origin there, or the outline in the rig (`rig --from` writes that rig)."
    if fit.sd[SIZE] == 0.0:  # the contacts are on one side
        advice += " Or the size is wrong: push other sides too, to separate the two."
    return Finding("outline_shifted", "warning", sentence, advice, {"x": x, "y": y})


def _size(contacts: Contacts, rig: Rig, cause: Cause) -> Finding:
    """The size if the tip's radius is right, and the radius if the size is right where the contacts fit both."""
    scale = cause.fit.value(SIZE, "1", 1.0)
    sentence = (
        f"The slider is {scale.value:.3f} times as large as its outline (sd {scale.sd or 0.0:.1g}), "
        f"{1e3 * (scale.value - 1.0) * half_size(rig):.1f} mm a side"
    )
    advice = f"Multiply the outline by {scale.value:.3f}"
    values = {"scale": scale}
    if cause.name != "tip_radius":
        tip = refit(cause.fit, contacts, rig, (TIP,), without=SIZE)
        if tip.cost <= TIE * cause.fit.cost:
            radius = tip.value(TIP, "m", rig.pusher_radius)
            values["radius_if_size_is_right"] = radius
            sentence += f", if the tip's radius is right. If the sizes are right, {_radius(radius, rig)}"
            more = 1e3 * float(tip.estimate[TIP])
            advice += f", or correct the tip radius by {more:.1f} mm: {UNSEPARATED}. Measure both again"
    return Finding("outline_size", "warning", f"{sentence}.", f"{advice}.", values)


def _tip(cause: Cause, rig: Rig) -> Finding:
    radius = cause.fit.value(TIP, "m", rig.pusher_radius)
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
    """The pose of the pusher's world frame in the slider's: p' = turn(p) + shift, and the ratio of their lengths."""
    yaw = fit.value(FRAME_YAW, "rad")
    shift = fit.centre + fit.estimate[[FRAME_X, FRAME_Y]] - rotate(fit.centre, np.array(yaw.value))
    sd = np.hypot(fit.sd[[FRAME_X, FRAME_Y]], np.abs(fit.centre[::-1]) * fit.sd[FRAME_YAW])
    degrees, (x, y) = np.degrees(yaw.value), np.round(1e3 * shift, 1) + 0.0
    frame = {f"frame_{name}": Value(float(s), "m", float(d)) for name, s, d in zip("xy", shift, sd, strict=True)}
    values = {"frame_yaw": yaw, **frame}
    if fit.shows(SCALE):
        share = fit.value(SCALE, "1")
        scale = Value(1.0 / (1.0 - share.value), "1", share.sd)
        sentence = (
            f"The slider's world is {scale.value:.4f} times (sd {scale.sd or 0.0:.1g}) as large as the pusher's: "
            "distances between its places are wrong."
        )
        advice = "Calibrate the tracker again: its scale (wand), and its frame against the robot's."
        return Finding("frames_apart", "warning", sentence, advice, {**values, "frame_scale": scale})
    sentence = (
        f"The world frames of slider and pusher are apart: the pusher's is turned by {degrees:.1f} degrees (sd "
        f"{np.degrees(yaw.sd or 0.0):.1g}) and shifted by ({x:.1f}, {y:.1f}) mm (sd {1e3 * sd[0]:.1g}, "
        f"{1e3 * sd[1]:.1g}) in the slider's."
    )
    advice = (
        f"Calibrate tracker and robot again, or turn the pusher's positions by {degrees:.1f} degrees about the world "
        f"origin and add ({x:.1f}, {y:.1f}) mm."
    )
    if not fit.shows(FRAME_YAW):
        advice += f" Or the tracked point of the pusher is so far from its tip: {TIP_POSE}"
    return Finding("frames_apart", "warning", sentence, advice, values)


def _tip_offset(fit: OutlineFit) -> Finding:
    x, y = (fit.value(each, "m") for each in TOOL)
    sentence = (
        f"The tip is at ({1e3 * x.value:.1f}, {1e3 * y.value:.1f}) mm (sd {1e3 * (x.sd or 0.0):.1g}, "
        f"{1e3 * (y.sd or 0.0):.1g}) from the tracked point of the pusher, along its own axes, and turns with them."
    )
    return Finding("tip_offset", "warning", sentence, f"{TIP_POSE[0].upper()}{TIP_POSE[1:]}", {"x": x, "y": y})


def clocks_apart(lag: Value, the: str = "The") -> Finding:
    """The finding that the slider's stamps are late (s), or early."""
    side, sd = "late" if lag.value > 0.0 else "early", 1e3 * (lag.sd or 0.0)
    sentence = f"{the} slider's stamps are {1e3 * abs(lag.value):.0f} ms {side} (sd {sd:.2g} ms) against the pusher's."
    advice = (
        "Synchronise the clocks (chrony, PTP), or correct the stamps. A filter of the tracker has the effect of late "
        "ones, and so has a commanded pose of the tip: record neither."
    )
    return Finding("clocks_apart", "warning", sentence, advice, {"lag": lag})


# --- the cause --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Cause:
    """The cause that explains the contacts, and its fit; rival: a fit of other proportions that explains as much."""

    name: Name
    fit: OutlineFit
    rival: OutlineFit | None = None


def cause_of(contacts: Contacts, rig: Rig, fit: OutlineFit) -> Cause:
    """The cause of the gaps between contacts and outline, from the fit of yaw, shift, size and clock lag alone."""
    if fit.spread < FINE and not fit.shows(SIZE, YAW, X, Y):
        return Cause("outline", fit)
    tried = {name: each for name in FURTHER if (each := further_cause(name, contacts, rig, fit)) is not None}
    tip = _with_tip(contacts, rig, fit)
    least = min([fit.penalised, *(each.penalised for each in tried.values())])
    if tip is not None and tip.penalised <= TIE * min(least, tip.penalised):
        axes = _refitted("proportions", contacts, rig, fit)
        return Cause("tip_radius", tip, axes if axes is not None and axes.cost <= TIE * tip.cost else None)
    name = next((name for name, each in tried.items() if each.penalised <= TIE * least), None)
    return Cause("outline", fit) if name is None else Cause(name, tried[name])


def further_cause(name: Name, contacts: Contacts, rig: Rig, fit: OutlineFit) -> OutlineFit | None:
    """The fit with a cause of FURTHER, None unless it is shown and leaves clearly less."""
    found = _refitted(name, contacts, rig, fit)
    if found is None:
        return None
    shown = FURTHER[name]
    if name == "frames_apart":
        shown, scaled = (*shown, SCALE), refit(found, contacts, rig, (SCALE,))
        if scaled.shows(SCALE) and TIE * scaled.penalised < found.penalised:
            found = scaled
    explained = found.spread < LENGTH_ALLOWANCE + contacts.noise and TIE * found.penalised < fit.penalised
    return found if explained and found.shows(*shown) else None


def _refitted(name: Name, contacts: Contacts, rig: Rig, fit: OutlineFit) -> OutlineFit | None:
    """The fit with a cause of FURTHER, None where it cannot be."""
    if name == "tip_offset" and (contacts.tool is None or np.ptp(contacts.tool) < LEAST_TURN):
        return None  # along the axes of a tool that does not turn, it is a shift of the world frame
    if name == "proportions" and not (_has_two_sizes(rig) and fit.sd[SIZE] > 0.0):
        return None
    return refit(fit, contacts, rig, FURTHER[name])


def _with_tip(contacts: Contacts, rig: Rig, fit: OutlineFit) -> OutlineFit | None:
    """With the tip's radius too, if the size is wrong, and the contacts show both, by a plausible amount."""
    if not fit.shows(SIZE):
        return None
    both = refit(fit, contacts, rig, (TIP,))
    separate = both.sd[SIZE] > 0.0 and max(float(both.sd[SIZE]) * half_size(rig), float(both.sd[TIP])) < SEPARATE
    thicker, growth = abs(both.estimate[TIP]), abs(both.estimate[SIZE])
    plausible = thicker <= LARGEST_TIP_CHANGE * rig.pusher_radius and growth <= LARGEST_SIZE_CHANGE
    return both if separate and plausible and both.shows(TIP) else None


def _has_two_sizes(rig: Rig) -> bool:
    """Whether the outline is an ellipse or a rectangle: its sizes along two axes may be wrong by different amounts."""
    outline = rig.outline
    if outline.semi_axes is not None:
        return outline.semi_axes[0] != outline.semi_axes[1]
    sides = np.roll(outline.vertices, -1, axis=0) - outline.vertices
    along = np.abs(sides / np.linalg.norm(sides, axis=1, keepdims=True)).max(axis=1)
    return len(sides) == 4 and bool(np.all(along > 1.0 - RIGHT_ANGLE))


def _shift_explains(contacts: Contacts, rig: Rig, cause: Cause) -> bool:
    """Whether the contacts lie farther off without a component of the shift.

    Along a single side they do not, up to its corner: a fit that ends there has a small standard deviation.
    """
    same = (TIP,) if cause.name == "tip_radius" else ()
    without = [refit(cause.fit, contacts, rig, same, without=each) for each in (X, Y) if cause.fit.shows(each)]
    return any(cause.fit.penalised < each.penalised for each in without)
