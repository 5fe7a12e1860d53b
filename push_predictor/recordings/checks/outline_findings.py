# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Findings on the outline's yaw, shift and size, on the tip's radius and on the clocks, from the fitted correction."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.outline_fit import Contacts, OutlineFit, fit_outline, fit_outline_and_tip
from push_predictor.recordings.rig import Rig

FEWEST_PUSHES = 8  # for five parameters: with fewer, the spread between pushes gives no standard deviation
DOUBT = 4.0  # standard deviations that an estimate must exceed, in addition to its allowance
LENGTH_ALLOWANCE, ANGLE_ALLOWANCE, LAG_ALLOWANCE = 0.0005, np.radians(1.0), 0.01  # m, rad, s: marker and clock accuracy
SEPARATE = 0.0002  # m; sd of size and tip radius, fitted together, above which the contacts do not separate them


def outline_findings(contacts: Contacts, rig: Rig, fit: OutlineFit) -> list[Finding]:
    """What a fit of the rig's outline to the contacts shows. Lengths in m, angles in rad, times in s."""
    if fit.pushes < FEWEST_PUSHES:
        return [unchecked(fit.pushes)]
    half, fit = half_size(rig), with_tip(contacts, rig, fit)
    found = [*_pose_findings(fit, rig)]
    if _resized(fit, half):
        found.append(_size(Value(1.0 + fit.estimate[3], "1", fit.sd[3]), half, separate=fit.sd[5] > 0.0))
    if abs(fit.estimate[5]) > DOUBT * fit.sd[5] + LENGTH_ALLOWANCE:
        found.append(_tip(Value(rig.pusher_radius + fit.estimate[5], "m", fit.sd[5]), rig))
    return [*found, *_clock_findings(fit)]


def fit_rig(contacts: Contacts, rig: Rig) -> OutlineFit:
    """The correction of the rig's outline that fits the contacts."""
    return fit_outline(rig.outline, rig.pusher_radius, contacts)


def with_tip(contacts: Contacts, rig: Rig, fit: OutlineFit) -> OutlineFit:
    """The fit with the tip's radius too, if the size is wrong and the contacts separate the two; else the given fit."""
    half = half_size(rig)
    if not _resized(fit, half):
        return fit
    both = fit_outline_and_tip(rig.outline, rig.pusher_radius, contacts, fit)
    return both if max(both.sd[3] * half, both.sd[5]) < SEPARATE else fit


def half_size(rig: Rig) -> float:
    """Distance from the centre to a side, m, of a regular outline with this area and perimeter."""
    return 2.0 * rig.outline.area / rig.outline.perimeter


def _resized(fit: OutlineFit, half: float) -> bool:
    return bool(abs(fit.estimate[3]) * half > DOUBT * fit.sd[3] * half + LENGTH_ALLOWANCE)


def unchecked(pushes: int) -> Finding:
    """The finding that there are too few pushes to estimate the outline from."""
    count = "push was" if pushes == 1 else "pushes were"
    sentence = f"Only {pushes} {count} recorded: yaw, shift and size of the outline cannot be estimated."
    advice = f"Record at least {FEWEST_PUSHES} pushes, on all sides."
    return Finding("outline_unchecked", "note", sentence, advice, {"pushes": Value(pushes, "1")})


def _pose_findings(fit: OutlineFit, rig: Rig) -> list[Finding]:
    yaw, x, y = fit.estimate[:3].tolist()
    yaw_sd, x_sd, y_sd = fit.sd[:3].tolist()
    found = []
    if abs(yaw) > DOUBT * yaw_sd + ANGLE_ALLOWANCE:
        found.append(_turned(Value(yaw, "rad", yaw_sd)))
    if any(abs(s) > DOUBT * sd + LENGTH_ALLOWANCE for s, sd in ((x, x_sd), (y, y_sd))):
        found.append(_shifted(Value(x, "m", x_sd), Value(y, "m", y_sd), rig, one_side=fit.sd[3] == 0.0))
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


def _size(scale: Value, half: float, separate: bool) -> Finding:
    more = 1e3 * (scale.value - 1.0) * half
    sd = f"sd {scale.sd or 0.0:.1g}"
    sentence = f"The slider is {scale.value:.3f} times as large as its outline ({sd}), {more:.1f} mm a side."
    advice = f"Multiply the outline by {scale.value:.3f}"
    if not separate:
        advice += f", or correct the tip radius by {more:.1f} mm: these contacts do not separate the two"
    return Finding("outline_size", "warning", sentence, f"{advice}.", {"scale": scale})


def _tip(radius: Value, rig: Rig) -> Finding:
    stated = f"{1e3 * rig.pusher_radius:.2f} mm in the rig"
    sentence = f"The tip's radius is {1e3 * radius.value:.2f} mm (sd {1e3 * (radius.sd or 0.0):.2f}), {stated}."
    return Finding("tip_radius", "warning", sentence, "Correct pusher_radius in the rig.", {"radius": radius})


def _clock_findings(fit: OutlineFit) -> list[Finding]:
    lag, sd = float(fit.estimate[4]), float(fit.sd[4])
    if abs(lag) <= DOUBT * sd + LAG_ALLOWANCE:
        return []
    side = "late" if lag > 0.0 else "early"
    sentence = f"The slider's stamps are {1e3 * abs(lag):.0f} ms {side} (sd {1e3 * sd:.0f} ms) against the pusher's."
    advice = "Synchronise the clocks (chrony, PTP), or correct the stamps."
    return [Finding("clocks_apart", "warning", sentence, advice, {"lag": Value(lag, "s", sd)})]
