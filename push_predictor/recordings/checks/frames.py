"""Streams exchanged, frames mirrored, an outline turned, shifted or of the wrong size, and clocks apart.

The tip's positions in contact decide. Each hypothesis about the streams is fitted; the one that leaves the smallest gap
between tip and outline is named if the streams as recorded leave a large one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.geometry.frames import to_body
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.motion import body_velocity, motion_of
from push_predictor.recordings.checks.outline_fit import OutlineFit, fit_outline
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.windows.push_window import WindowOptions

FEWEST_CONTACTS = 20  # samples
FEWEST_PUSHES = 8  # for five parameters: with fewer, the spread between pushes gives no standard deviation
DOUBT = 4.0  # standard deviations that an estimate must exceed, in addition to its allowance
LENGTH_ALLOWANCE, ANGLE_ALLOWANCE, LAG_ALLOWANCE = 0.0005, np.radians(1.0), 0.01  # m, rad, s: marker and clock accuracy
LARGE_GAP = 0.0005  # m; the outline explains the contacts if the median gap is smaller
BETTER = 0.4  # a hypothesis is named if it leaves less than this share of the gap
LARGEST_GROWTH = 0.5  # relative: a larger correction of the size means another slider
AT_REST = 0.1  # share of the slider's motion; a slider moves only with the tip, or in a hand
TIE = 1.3  # hypotheses with gaps up to this ratio fit equally well: the more usual one is named
FAR = 0.1  # of the outline's reach: a larger gap is no contact of this tip with this slider

TOPICS = "Check the topics of slider and pusher, and that they are given in one world frame."
MIRRORS = {
    "heading_clockwise": (1.0, -1.0, "the slider's heading", "Negate the heading: counter-clockwise is positive."),
    "frame_mirrored": (-1.0, -1.0, "the slider's y axis and heading", "Use right-handed frames, seen from above."),
    "y_mirrored": (-1.0, 1.0, "the slider's y axis", "Use right-handed frames, seen from above."),
}


def frame_findings(recording: Recording, rig: Rig) -> list[Finding]:
    """Findings about topics, frames, outline and clocks. Lengths in m, angles in rad, times in s."""
    if (fit := _fit(recording, rig)) is None:
        return _without_contact(recording, rig)
    reach = _reach(rig)
    if rig.outline.rotational_symmetry == 0 and _leads(recording, rig) > AT_REST > 3.0 * _leads(
        swapped(recording), rig
    ):
        return [_swapped(fit.gap)]
    if fit.gap < LARGE_GAP and not _is_implausible(fit, reach):
        return [*_outline_findings(fit, rig), *_clock_findings(fit)]
    explained = min(BETTER * fit.gap, FAR * reach)
    if _gap(swapped(recording), rig) < explained:
        return [_swapped(fit.gap)]
    mirrors = {name: _gap(mirrored(recording, y, heading), rig) for name, (y, heading, *_) in MIRRORS.items()}
    best = next(name for name, gap in mirrors.items() if gap <= TIE * min(mirrors.values()))
    if mirrors[best] < explained:
        return [_mirrored(best, fit.gap, mirrors[best])]
    if fit.gap > FAR * reach or _is_implausible(fit, reach):
        return [_another_body(_gap_as_recorded(recording, rig))]
    return [*_outline_findings(fit, rig), *_clock_findings(fit), _unexplained(fit.gap)]


def swapped(recording: Recording) -> Recording:
    """The recording with slider and pusher exchanged."""
    return replace(recording, slider=recording.pusher, pusher=recording.slider)


def mirrored(recording: Recording, y: float, heading: float) -> Recording:
    """The recording with the slider's y and heading multiplied by the given signs."""
    slider = recording.slider
    return replace(recording, slider=replace(slider, y=y * slider.y, heading=heading * slider.heading))


def _fit(recording: Recording, rig: Rig) -> OutlineFit | None:
    motion = motion_of(recording, rig)
    if motion is None or np.sum(motion.contact) < FEWEST_CONTACTS:
        return None
    touch = motion.contact
    tips = to_body(motion.tip, motion.slider)[touch]
    return fit_outline(rig.outline, rig.pusher_radius, tips, body_velocity(motion)[touch], motion.push[touch])


def _gap(recording: Recording, rig: Rig) -> float:
    """The gap (m) that the best plausible correction leaves, infinity without one."""
    fit = _fit(recording, rig)
    return fit.gap if fit is not None and not _is_implausible(fit, _reach(rig)) else np.inf


def _reach(rig: Rig) -> float:
    return float(np.max(np.linalg.norm(rig.outline.vertices, axis=1)))


def _gap_as_recorded(recording: Recording, rig: Rig) -> float:
    motion = motion_of(recording, rig)
    assert motion is not None, "it was fitted before"
    tips = to_body(motion.tip, motion.slider)[motion.contact]
    return float(np.median(np.abs(rig.outline.project(tips).distance - rig.pusher_radius)))


def _leads(recording: Recording, rig: Rig) -> float:
    """Share of the slider's motion while the tip rests. A circle and its tip exchanged leave the same gap."""
    motion = motion_of(recording, rig)
    if motion is None or not motion.moving.any():
        return 0.0
    return float(np.mean(motion.tip_speed[motion.moving] < WindowOptions().least_speed))


def _is_implausible(fit: OutlineFit, reach: float) -> bool:
    """Whether the correction is another slider rather than a mistake in this one's outline."""
    return bool(np.hypot(fit.estimate[1], fit.estimate[2]) > reach or abs(fit.estimate[3]) > LARGEST_GROWTH)


def _without_contact(recording: Recording, rig: Rig) -> list[Finding]:
    if _gap(swapped(recording), rig) < LARGE_GAP:
        return [_swapped(np.inf)]
    sentence = "The slider never moves while the lowered tip moves: no push was recorded."
    return [Finding("no_contact", "refused", sentence, TOPICS)]


def _swapped(gap: float) -> Finding:
    values = {"gap": Value(gap, "m")} if np.isfinite(gap) else {}
    sentence = "Slider and pusher are exchanged: the contacts fit the outline only the other way round."
    return Finding("topics_swapped", "refused", sentence, "Exchange the topics of slider and pusher.", values)


def _another_body(gap: float) -> Finding:
    sentence = f"While the slider moves, the tip is {1e3 * gap:.0f} mm from the outline, in the median."
    return Finding("another_body", "refused", sentence, TOPICS, {"gap": Value(gap, "m")})


def _mirrored(name: str, gap: float, after: float) -> Finding:
    what, advice = MIRRORS[name][2:]
    sentence = (
        f"The sign of {what} is wrong. With the sign changed, the median gap in contact falls from "
        f"{1e3 * gap:.1f} mm to {1e3 * after:.2f} mm."
    )
    values = {"gap": Value(gap, "m"), "gap_after": Value(after, "m")}
    return Finding(name, "warning", sentence, advice, values)


def _unexplained(gap: float) -> Finding:
    sentence = f"The tip is {1e3 * gap:.1f} mm from the outline in contact, in the median, after the best correction."
    advice = "Check the outline's vertices, and the calibration between tracker and robot."
    return Finding("outline_misfit", "warning", sentence, advice, {"gap": Value(gap, "m")})


def _outline_findings(fit: OutlineFit, rig: Rig) -> list[Finding]:
    if fit.pushes < FEWEST_PUSHES:
        return [_unchecked(fit.pushes)]
    yaw, x, y, growth, _ = fit.estimate.tolist()
    yaw_sd, x_sd, y_sd, growth_sd, _ = fit.sd.tolist()
    half = 2.0 * rig.outline.area / rig.outline.perimeter  # from the centre to a side, of a regular outline
    turned = abs(yaw) > DOUBT * yaw_sd + ANGLE_ALLOWANCE
    shifted = any(abs(s) > DOUBT * sd + LENGTH_ALLOWANCE for s, sd in ((x, x_sd), (y, y_sd)))
    resized = abs(growth) * half > DOUBT * growth_sd * half + LENGTH_ALLOWANCE
    found = []
    if turned:
        found.append(_turned(Value(yaw, "rad", yaw_sd)))
    if shifted:
        found.append(_shifted(Value(x, "m", x_sd), Value(y, "m", y_sd), growth_sd == 0.0))
    if resized:
        found.append(_resized(Value(1.0 + growth, "1", growth_sd), half))
    return found


def _unchecked(pushes: int) -> Finding:
    sentence = f"Only {pushes} pushes were recorded: yaw, shift and size of the outline cannot be estimated."
    advice = f"Record at least {FEWEST_PUSHES} pushes, on all sides."
    return Finding("outline_unchecked", "note", sentence, advice, {"pushes": Value(pushes, "1")})


def _turned(yaw: Value) -> Finding:
    degrees, sd = np.degrees(yaw.value), np.degrees(yaw.sd or 0.0)
    sentence = f"The slider is turned by {degrees:.1f} degrees (sd {sd:.2f}) against its outline."
    advice = f"Turn the outline in the rig, or the tracked frame's axes, by {degrees:.1f} degrees."
    return Finding("outline_turned", "warning", sentence, advice, {"yaw": yaw})


def _shifted(x: Value, y: Value, one_side: bool) -> Finding:
    sentence = (
        f"The slider's centre is at ({1e3 * x.value:.1f}, {1e3 * y.value:.1f}) mm in the tracked frame "
        f"(sd {1e3 * (x.sd or 0.0):.2f}, {1e3 * (y.sd or 0.0):.2f}), not at its origin."
    )
    advice = "Move the tracked frame's origin there."
    if one_side:
        advice += " Or the size is wrong: push other sides too, to separate the two."
    return Finding("outline_shifted", "warning", sentence, advice, {"x": x, "y": y})


def _resized(scale: Value, half: float) -> Finding:
    more = 1e3 * (scale.value - 1.0) * half
    sd = f"sd {scale.sd or 0.0:.1g}"
    sentence = f"The slider is {scale.value:.3f} times as large as its outline ({sd}), {more:.1f} mm a side."
    advice = f"Multiply the outline by {scale.value:.3f}, or correct the tip radius by {more:.1f} mm."
    return Finding("outline_size", "warning", sentence, advice, {"scale": scale})


def _clock_findings(fit: OutlineFit) -> list[Finding]:
    lag, sd = float(fit.estimate[4]), float(fit.sd[4])
    if fit.pushes < FEWEST_PUSHES or abs(lag) <= DOUBT * sd + LAG_ALLOWANCE:
        return []
    side = "late" if lag > 0.0 else "early"
    sentence = f"The slider's stamps are {1e3 * abs(lag):.0f} ms {side} (sd {1e3 * sd:.0f} ms) against the pusher's."
    advice = "Synchronise the clocks (chrony, PTP), or correct the stamps."
    return [Finding("clocks_apart", "warning", sentence, advice, {"lag": Value(lag, "s", sd)})]
