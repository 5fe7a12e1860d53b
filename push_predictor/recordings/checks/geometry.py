# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Streams exchanged, frames or outline mirrored, an outline turned, shifted or of the wrong size, and clocks apart.

The tip's positions in contact decide. Each hypothesis about the streams is fitted; the one that leaves the smallest gap
between tip and outline is named if the streams as recorded leave a large one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.errors import RigError
from push_predictor.geometry.frames import rotate, to_body, to_world
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import has_mirror_symmetry, mirror_image, transformed, transformed_points
from push_predictor.recordings.checks.finding import Evidence, Finding, Value
from push_predictor.recordings.checks.motion import Motion, motion_of
from push_predictor.recordings.checks.outline_findings import (
    FEWEST_PUSHES,
    LARGEST_SIZE_CHANGE,
    LARGEST_TIP_CHANGE,
    TIP_POSE,
    further_cause,
    outline_findings,
    unchecked,
)
from push_predictor.recordings.checks.outline_fit import (
    FEWEST_CONTACTS,
    LAG,
    LAG_ALLOWANCE,
    LENGTH_ALLOWANCE,
    SIZE,
    TIE,
    Contacts,
    OutlineFit,
    X,
    Y,
    contacts_of,
    fit_outline,
)
from push_predictor.recordings.checks.units import orientation_finding
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.windows.push_window import WindowOptions

LARGE_GAP = 0.0005  # m; the outline explains the contacts if the median gap is smaller
BETTER = 0.4  # a hypothesis is named if it leaves less than this share of the gap
LARGEST_GROWTH = 0.5  # relative: a larger correction of the size means another slider
AT_REST = 0.1  # share of the slider's motion; a slider moves only with the tip, or in a hand
EXACT = 5e-5  # m; no further hypothesis is tried after one with a smaller gap, which is less than a tracker's noise
FEW_SAMPLES = 150  # enough for the gap alone, of hypotheses that are mostly wrong
FAR = 0.1  # of the outline's reach: a larger gap is no contact of this tip with this slider

RIGHT_HANDED = "Use right-handed frames, seen from above."
FROM_ABOVE = f"{RIGHT_HANDED} If z points down in the slider's frame, `--up=slider=-z` does that."
IN_ORDER = "Give x before y, in right-handed frames seen from above."
TOPICS = "Check the topics of slider and pusher, and that they are given in one world frame."
CORRECTED = ("outline_mirrored", "outline_turned", "outline_shifted", "outline_size", "tip_radius")
CENTRED_WITHIN = 0.5 * LENGTH_ALLOWANCE


@dataclass(frozen=True)
class Mirror:
    """What undoes the mistake: rows that multiply the slider's x and y, and the sign of its heading.

    A constant turn of the heading is part of the fitted yaw.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    heading: float
    mistake: str
    advice: str


def _sign(what: str) -> str:
    return f"The sign of the slider's {what} is wrong."


# The first of those that fit equally well is named.
MIRRORS = {
    "heading_clockwise": Mirror(
        (1.0, 0.0), (0.0, 1.0), -1.0, _sign("heading"), "Negate the heading: counter-clockwise is positive."
    ),
    "frame_mirrored": Mirror((1.0, 0.0), (0.0, -1.0), -1.0, _sign("y axis and heading"), FROM_ABOVE),
    "frame_mirrored_x": Mirror((-1.0, 0.0), (0.0, 1.0), -1.0, _sign("x axis and heading"), FROM_ABOVE),
    "axes_exchanged": Mirror(
        (0.0, 1.0), (1.0, 0.0), -1.0, "The slider's x and y axes are exchanged, its heading too.", IN_ORDER
    ),
    "y_mirrored": Mirror((1.0, 0.0), (0.0, -1.0), 1.0, _sign("y axis"), RIGHT_HANDED),
    "x_mirrored": Mirror((-1.0, 0.0), (0.0, 1.0), 1.0, _sign("x axis"), RIGHT_HANDED),
    "xy_exchanged": Mirror(
        (0.0, 1.0), (1.0, 0.0), 1.0, "The slider's x and y positions are exchanged, its heading is not.", IN_ORDER
    ),
}
PREVENTS = (*MIRRORS, "outline_unchecked", "outline_misfit", "outline_shape")


def geometry_stage(evidence: Evidence) -> Evidence:
    """Whether the tip's positions in contact fit the outline; unknown where a tilted view distorts them."""
    if evidence.has("world_tilted"):
        return evidence
    found = geometry_findings(evidence.recording, evidence.rig, evidence.motion)
    if evidence.synchronous:
        found = [finding for finding in found if finding.name != "clocks_apart"]
    oriented = orientation_finding(evidence.recording.slider, evidence.rig)
    if oriented is not None and oriented.severity == "refused" and all(each.name != "topics_swapped" for each in found):
        found = [oriented]
    return evidence.found(found)


def geometry_findings(recording: Recording, rig: Rig, motion: Motion | None) -> list[Finding]:
    """Findings about topics, frames, outline and clocks. Lengths in m, angles in rad, times in s.

    motion: that of the recording.
    """
    if (contacts := contacts_of(motion)) is None:
        return _without_contact(recording, rig, motion)
    if motion is not None and (pushes := _too_brief(motion, rig)) is not None:
        return [unchecked(pushes)]
    contacts, fit = _fit_on_one_clock(recording, rig, contacts)
    round_, leads = rig.outline.rotational_symmetry == 0, _leads(motion)
    if round_ and leads > AT_REST > 3.0 * _leads(motion_of(swapped(recording), rig)):
        return [_swapped(fit.gap)]
    if fit.pushes < FEWEST_PUSHES and _gap_as_recorded(contacts, rig) < WindowOptions().touch_gap_alone:
        return [unchecked(fit.pushes)]  # so few pushes fit a slider far away as well
    if fit.gap >= LARGE_GAP + contacts.noise or _is_implausible(fit, rig):
        return _findings_of_large_gap(recording, rig, motion, contacts, fit)
    found = outline_findings(contacts, rig, fit)
    return found and (_mirror_image_findings(contacts, rig, fit.gap, BETTER * fit.gap) or found)


def _findings_of_large_gap(
    recording: Recording, rig: Rig, motion: Motion | None, contacts: Contacts, fit: OutlineFit
) -> list[Finding]:
    """The first hypothesis that leaves a clearly smaller gap than the corrected outline; else what that shows."""
    far = FAR * rig.outline.reach
    explained = min(BETTER * fit.gap, far)
    if _fits_swapped(recording, rig, motion, explained):
        return [_swapped(fit.gap)]
    mirrors = _mirror_gaps(contacts, rig)
    best = next(name for name, gap in mirrors.items() if gap <= TIE * min(mirrors.values()))
    if found := _mirror_image_findings(contacts, rig, fit.gap, min(explained, mirrors[best])):
        return found
    if mirrors[best] < explained:
        mirror = MIRRORS[best]
        return [_falling(best, f"{mirror.mistake} With it corrected", mirror.advice, fit.gap, mirrors[best])]
    another = fit.gap > far or _is_implausible(fit, rig)
    if another and all(further_cause(each, contacts, rig, fit) is None for each in ("frames_apart", "tip_offset")):
        recorded = _gap_as_recorded(contacts, rig)
        return [_another_body(recorded) if recorded > far else _unexplained(recorded)]
    found = outline_findings(contacts, rig, fit)
    otherwise = any(finding.name in ("frames_apart", "tip_offset", "outline_shape") for finding in found)
    return found if another or otherwise else [*found, _unexplained(fit.gap)]


def swapped(recording: Recording) -> Recording:
    """The recording with slider and pusher exchanged."""
    return replace(recording, slider=recording.pusher, pusher=recording.slider)


def _too_brief(motion: Motion, rig: Rig) -> int | None:
    """The number of pushes that are steady, None unless they are few because others are too fast or too short.

    A tip that hits a slider at high speed loses it again, and is at the outline for a moment only.
    """
    steady, pushes = len(np.unique(motion.push[motion.steady])), np.unique(motion.push[motion.contact])
    if steady >= FEWEST_PUSHES or len(pushes) < FEWEST_PUSHES:
        return None
    gap = np.abs(rig.outline.project(to_body(motion.tip, motion.slider)).distance - rig.pusher_radius)
    nearest = [float(np.min(gap[motion.contact & (motion.push == push)])) for push in pushes]
    return steady if np.median(nearest) < WindowOptions().touch_gap else None


def _fit_on_one_clock(recording: Recording, rig: Rig, contacts: Contacts) -> tuple[Contacts, OutlineFit]:
    """The contacts and their fit, once more with the stamps corrected where the clocks are apart."""
    fit = fit_outline(contacts, rig)
    lag = float(fit.estimate[LAG])
    if abs(lag) <= LAG_ALLOWANCE or fit.gap > LARGE_GAP + contacts.noise:
        return contacts, fit
    slider = recording.slider
    corrected = replace(recording, slider=replace(slider, stamp=slider.stamp - round(1e9 * lag)))
    if (again := contacts_of(motion_of(corrected, rig))) is None:
        return contacts, fit
    better = fit_outline(again, rig)
    return (replace(again, lag=lag), better) if better.cost < fit.cost else (contacts, fit)


def _fits_swapped(recording: Recording, rig: Rig, motion: Motion | None, most: float) -> bool:
    """Whether the tip follows the slider, and the streams exchanged, corrected at best, leave less than `most` m."""
    if not tip_follows(motion, recording, rig):
        return False
    contacts = contacts_of(motion_of(swapped(recording), rig))
    return contacts is not None and _gap_of(contacts, rig) < most


def _gap_of(contacts: Contacts, rig: Rig) -> float:
    """The gap (m) that the best plausible correction leaves, infinity without one."""
    fit = fit_outline(contacts.drawn(FEW_SAMPLES), rig)
    return np.inf if _is_implausible(fit, rig) else fit.gap


def _mirror_gaps(contacts: Contacts, rig: Rig) -> dict[str, float]:
    """Gaps (m) by the name of the mirror, up to the first that explains the contacts exactly."""
    gaps = {}
    for name, mirror in MIRRORS.items():
        gaps[name] = _gap_of(_reflected(contacts, mirror), rig)
        if gaps[name] < EXACT:
            break
    return gaps


def _gap_as_recorded(contacts: Contacts, rig: Rig) -> float:
    return float(np.median(np.abs(rig.outline.project(contacts.tips).distance - rig.pusher_radius)))


def _leads(motion: Motion | None) -> float:
    """Share of the slider's motion while the tip rests. A circle and its tip exchanged leave the same gap."""
    if motion is None or not motion.moving.any():
        return 0.0
    return float(np.mean(motion.tip_speed[motion.moving] < WindowOptions().least_speed))


def tip_follows(motion: Motion | None, recording: Recording, rig: Rig) -> bool:
    """Whether the tip rests more often while the slider moves than the other way round, as after an exchange.

    Without this evidence, a circle in a world frame shifted by some millimetres fits better as its own tip.
    """
    return _leads(motion) > _leads(motion_of(swapped(recording), rig))


def _is_implausible(fit: OutlineFit, rig: Rig) -> bool:
    """Whether the correction is another slider rather than a mistake in this one's outline."""
    return bool(np.hypot(*fit.estimate[[X, Y]]) > rig.outline.reach or abs(fit.estimate[SIZE]) > LARGEST_GROWTH)


def _reflected(contacts: Contacts, mirror: Mirror) -> Contacts:
    """The contacts with the slider's poses corrected; the same samples are in contact."""
    world, velocities = to_world(contacts.tips, contacts.poses), rotate(contacts.velocities, contacts.poses[:, 2])
    places = contacts.poses[:, :2] @ np.array([mirror.x, mirror.y]).T
    poses = np.column_stack([places, mirror.heading * contacts.poses[:, 2]])
    return replace(contacts, tips=to_body(world, poses), velocities=rotate(velocities, -poses[:, 2]), poses=poses)


def _mirror_image_findings(contacts: Contacts, rig: Rig, gap: float, most: float) -> list[Finding]:
    """Findings if the outline's mirror image leaves a gap of less than `most` m; none for a symmetric outline."""
    if has_mirror_symmetry(rig.outline) or len(np.unique(contacts.push)) < FEWEST_PUSHES:
        return []
    image = replace(rig, outline=mirror_image(rig.outline))
    fit = fit_outline(contacts, image)
    if fit.gap >= most or _is_implausible(fit, rig):
        return []
    mistake = "The outline is the mirror image of the slider. Mirrored at the x axis"
    advice = "Change the sign of the outline's y, or use right-handed frames for both poses."
    mirrored = _falling("outline_mirrored", mistake, advice, gap, fit.gap)
    return [mirrored, *outline_findings(contacts, image, fit)]


def _without_contact(recording: Recording, rig: Rig, motion: Motion | None) -> list[Finding]:
    if _fits_swapped(recording, rig, motion, LARGE_GAP):
        return [_swapped(np.inf)]
    if motion is not None and (height := _pushing_height(recording, motion)) is not None:
        lowered = replace(recording.pusher, z=recording.pusher.z - height)
        altered = replace(recording, pusher=lowered)
        found = geometry_findings(altered, rig, motion_of(altered, rig))
        if all(finding.severity != "refused" for finding in found):
            return [_tip_height(height), *found]
    sentence = "The slider never moves while the lowered tip moves: no push was recorded."
    return [Finding("no_contact", "refused", sentence, TOPICS)]


def _pushing_height(recording: Recording, motion: Motion) -> float | None:
    """The height (m) of the tracked point above the slider's frame while both move, None if it is that of a tip."""
    pushing = motion.moving & (motion.tip_speed > WindowOptions().least_speed)
    if np.sum(pushing) < FEWEST_CONTACTS:
        return None
    above = float(np.nanmin(recording.pusher.z) - np.nanmedian(recording.slider.z))
    height = above + float(np.median(motion.tip_height[pushing]))
    return height if height > WindowOptions().lift else None


def _tip_height(height: float) -> Finding:
    lift = WindowOptions().lift
    sentence = (
        f"In pushes, the tracked point of the pusher is {1e3 * height:.0f} mm above the slider's frame, where a tip is "
        f"lifted (over {1e3 * lift:.0f} mm). It is probably about that far from the tip, along the tool, such as the "
        "flange; or the heights (z) of the two frames differ."
    )
    advice = f"{TIP_POSE[0].upper()}{TIP_POSE[1:]} Or correct z in one of the frames."
    return Finding("tip_height", "refused", sentence, advice, {"height": Value(height, "m")})


def _swapped(gap: float) -> Finding:
    values = {"gap": Value(gap, "m")} if np.isfinite(gap) else {}
    sentence = "Slider and pusher are exchanged: the contacts fit the outline only the other way round."
    return Finding("topics_swapped", "refused", sentence, "Exchange the topics of slider and pusher.", values)


def _another_body(gap: float) -> Finding:
    sentence = f"While the slider moves, the tip is {1e3 * gap:.0f} mm from the outline, in the median."
    return Finding("another_body", "refused", sentence, TOPICS, {"gap": Value(gap, "m")})


def _falling(name: str, mistake: str, advice: str, gap: float, after: float) -> Finding:
    """A warning about what explains the gap (m), of which a smaller one is left."""
    sentence = f"{mistake}, the median gap in contact falls from {1e3 * gap:.1f} mm to {1e3 * after:.2f} mm."
    values = {"gap": Value(gap, "m"), "gap_after": Value(after, "m")}
    return Finding(name, "warning", sentence, advice, values)


def _unexplained(gap: float) -> Finding:
    sentence = (
        f"The tip is {1e3 * gap:.1f} mm from the outline in contact, in the median, and no correction explains it."
    )
    advice = "Check the outline's vertices, and the calibration between tracker and robot."
    return Finding("outline_misfit", "warning", sentence, advice, {"gap": Value(gap, "m")})


# --- the rig with what was found about its outline and tip corrected --------------------------------------------------


def corrected_rig(rig: Rig, findings: Sequence[Finding]) -> Rig:
    """The rig whose outline and tip radius are those that the findings of `check_recording` estimate.

    Support points move with the outline. A clock lag and world frames apart are faults of the recording: they change
    nothing here. Without a finding, the rig is the same. Raises RigError that names the findings with which nothing can
    be corrected, or for a size or a tip's radius that no mistake of measurement explains.
    """
    if prevents := [each for each in findings if each.severity == "refused" or each.name in PREVENTS]:
        names, sentences = ", ".join(each.name for each in prevents), " ".join(each.sentence for each in prevents)
        raise RigError(f"no rig can be estimated ({names}): {sentences}")
    found = {finding.name: finding.values for finding in findings if finding.name in CORRECTED}
    if not found:
        return rig
    outline, points = rig.outline, rig.support_points
    if "outline_mirrored" in found:
        outline, points = mirror_image(outline), None if points is None else points * [1.0, -1.0, 1.0]
    yaw = found["outline_turned"]["yaw"].value if "outline_turned" in found else 0.0
    shift = found.get("outline_shifted")
    moved = (0.0, 0.0) if shift is None else _centring(outline, shift["x"].value, shift["y"].value)
    size = found["outline_size"]["scale"].value if "outline_size" in found else 1.0
    radius = found["tip_radius"]["radius"].value if "tip_radius" in found else rig.pusher_radius
    _check_plausible(rig, size, radius)
    if points is not None:
        places = transformed_points(outline, points[:, :2], yaw, moved, size)
        points = np.column_stack([places, points[:, 2]])
    corrected = transformed(outline, yaw, moved, size)
    return replace(rig, outline=corrected, pusher_radius=radius, support_points=points)


def _check_plausible(rig: Rig, size: float, radius: float) -> None:
    if not abs(size - 1.0) <= LARGEST_SIZE_CHANGE:
        raise RigError(
            f"outline: the contacts fit {size:.3f} times its size, which is not accepted, give sizes within "
            f"{100.0 * LARGEST_SIZE_CHANGE:.0f} %: measure them, and the tip radius, again"
        )
    if not abs(radius - rig.pusher_radius) <= LARGEST_TIP_CHANGE * rig.pusher_radius:
        raise RigError(
            f"pusher_radius: the contacts fit {1e3 * radius:.2f} mm in place of {1e3 * rig.pusher_radius:.2f} mm, "
            f"which is not accepted, give a radius within {100.0 * LARGEST_TIP_CHANGE:.0f} %: measure it again"
        )


def _centring(outline: Outline, x: float, y: float) -> tuple[float, float]:
    """The shift, exactly to the origin if it ends near it: a symmetric outline must not lose its symmetry to noise."""
    there = outline.centroid + [x, y]
    if np.hypot(*there) > CENTRED_WITHIN:
        return x, y
    x, y = (-outline.centroid).tolist()
    return x, y
