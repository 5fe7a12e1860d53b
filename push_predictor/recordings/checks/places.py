# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Jumps of the poses: between two bodies in one stream, between bodies that are exchanged, and of the heading."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.geometry.frames import rotate, wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.recordings.checks.finding import Finding, Severity, Value
from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.streams import PoseStream, Recording
from push_predictor.recordings.windows.flips import HeadingFlips, flip_steps
from push_predictor.recordings.windows.track import JUMP_DISTANCE, JUMP_SPEED
from push_predictor.types import Array, BoolArray, IntArray

USUAL = 90.0  # percentile of a body's own steps
LAG = 12  # samples: the next one of a body that has more than 10 % of them is at most about so far
JUMP = 20.0  # times the usual step
RETURN = 0.25  # of a jump: nearer to an earlier place than this, the stream is back there
RECENT = 6  # stretches of a stream whose ends are remembered
JUST = 500_000_000  # ns; a slider that is put back is elsewhere for longer
FEWEST_RETURNS = 5  # to two places
HALF = 0.12  # share of the samples elsewhere: with more, the window finder cannot know which body is meant
EXCHANGED = 0.02  # m between a body that was exchanged and the place where the other one was
SPAN = 100_000_000  # ns around an exchange
FEWEST = 3
LARGE = np.radians(42.0)  # below the smallest fixed angle
FIXED_SHARE = 0.7  # of the large steps; of random ones, as of headings in degrees, a quarter are near a fixed angle
COMMON = 0.1  # share of the flips by an angle that is listed
OFTEN = 0.2  # share of the samples: the slider may begin anew with a flipped heading
SAME = 1e-3  # m between an outline and the same after a turn that is its symmetry
ADVICE = (
    "Windows undo them, unless they are so many that the true heading is not known. Place the markers so that no turn "
    "of the body maps them onto each other."
)


@dataclass(frozen=True, eq=False)
class Places:
    """Stretches of a stream between jumps.

    jumps (n - 1,): which steps are jumps. returns: how often one leads back to where an earlier stretch just ended;
    distance: median of these jumps, m; share: of the samples around them that are at the place with fewer of them.
    """

    jumps: BoolArray
    returns: int = 0
    distance: float = 0.0
    share: float = 0.0


def places_of(stream: PoseStream) -> Places:
    """The stretches of a stream, in order of arrival. A pose at (0, 0) is that of a lost body."""
    seen = np.isfinite(stream.x + stream.y) & ((stream.x != 0.0) | (stream.y != 0.0))
    place, stamp = np.column_stack([stream.x, stream.y])[seen], stream.stamp[seen]
    if len(place) < 2:
        return Places(np.zeros(max(len(stream) - 1, 0), dtype=np.bool_))
    step = np.hypot(*np.diff(place, axis=0).T)
    elapsed = np.maximum(np.diff(stamp), 0) * NANOSECOND
    jumps = step > np.maximum(JUMP_DISTANCE + JUMP_SPEED * elapsed, JUMP * _usual_step(place))
    begins = np.append(0, np.flatnonzero(jumps) + 1)
    ends = np.append(begins[1:], len(place)) - 1
    returned = list[int]()
    for k in range(2, len(begins)):
        before = np.arange(max(0, k - RECENT), k - 1)
        before = before[stamp[begins[k]] - stamp[ends[before]] < JUST]
        away = np.hypot(*(place[ends[before]] - place[begins[k]]).T)
        if len(before) and away.min() < min(RETURN * step[begins[k] - 1], JUMP_DISTANCE):
            returned.append(k)
    if not returned:
        return Places(jumps)
    length, back = ends - begins + 1, np.array(returned)
    share = np.sum(np.minimum(length[back - 1], length[back])) / np.sum(length[back - 1] + length[back])
    return Places(jumps, len(returned), float(np.median(step[begins[back] - 1])), float(share))


def two_bodies(name: str, places: Places) -> Finding | None:
    """A finding if a stream jumps to and fro between two places."""
    if places.returns < FEWEST_RETURNS:
        return None
    sentence = (
        f"The {name}'s poses jump {places.returns} times to and fro between places "
        f"{1e3 * places.distance:.0f} mm apart ({100.0 * places.share:.0f} % of the samples are elsewhere): "
        "two bodies, or two nodes, publish on its topic."
    )
    advice = (
        "Give each body its own topic, and stop a second publisher (`ros2 topic info --verbose` lists both). Few "
        "samples elsewhere are discarded."
    )
    values = {"share": Value(places.share, "1"), "distance": Value(places.distance, "m")}
    return Finding(f"two_bodies_{name}", _severity(places.share), sentence, advice, values)


def exchanged(recording: Recording, slider: Places, pusher: Places) -> Finding | None:
    """A finding if slider and tip take each other's place, for a while or for good."""
    one, other = recording.slider, recording.pusher
    if len(slider.jumps) != len(one) - 1 or len(pusher.jumps) != len(other) - 1:
        return None
    at = np.flatnonzero(slider.jumps) + 1
    tips = np.flatnonzero(pusher.jumps) + 1
    if not (len(at) and len(tips)):
        return None
    place, tip = np.column_stack([one.x, one.y]), np.column_stack([other.x, other.y])
    nearest = tips[np.argmin(np.abs(other.stamp[tips][None, :] - one.stamp[at][:, None]), axis=1)]
    together = np.abs(other.stamp[nearest] - one.stamp[at]) < SPAN
    crossed = _near(place[at], tip[nearest - 1], place[at - 1]) & _near(tip[nearest], place[at - 1], tip[nearest - 1])
    times = np.sort(one.stamp[at[together & crossed]])
    if not len(times):
        return None
    ends = np.append(times, one.stamp[-1])[: len(times) + len(times) % 2]
    share = float(np.sum(ends[1::2] - ends[::2])) / float(one.stamp[-1] - one.stamp[0])
    begin = NANOSECOND * float(times[0] - one.stamp[0])
    sentence = (
        f"Slider and tip take each other's place {len(times)} time{'' if len(times) == 1 else 's'}, both in one "
        f"instant, first after {begin:.1f} s, and are exchanged for {100.0 * share:.0f} % of the time."
    )
    advice = "Give the bodies marker patterns that differ more. The windows break there."
    values = {"exchanges": Value(len(times), "1"), "share": Value(share, "1"), "begin": Value(begin, "s")}
    return Finding("bodies_exchanged", _severity(share), sentence, advice, values)


def _severity(share: float) -> Severity:
    """By the share of the samples that are elsewhere."""
    return "refused" if share > HALF else "warning"


def _near(one: Array, other: Array, before: Array) -> BoolArray:
    """Whether places are where the other body was, not where the same one was before, each (n, 2) m."""
    return np.asarray(np.hypot(*(one - other).T) < np.minimum(EXCHANGED, RETURN * np.hypot(*(one - before).T)))


def _usual_step(place: Array) -> float:
    """The step (m) that few exceed, to the nearest of the next samples: the others may be of other bodies."""
    ahead = [np.hypot(*(place[lag:] - place[:-lag]).T)[: max(len(place) - LAG, 0)] for lag in range(1, LAG + 1)]
    return float(np.percentile(np.min(ahead, axis=0), USUAL)) if len(place) > LAG else 0.0


# --- flips of the slider's heading by fixed angles --------------------------------------------------------------------


def without_flips(recording: Recording, outline: Outline) -> tuple[Finding | None, Recording]:
    """A finding if the heading flips by fixed angles, and the recording with the headings that the windows use.

    Refused if it flips so often that its true value is not known, and the angles are no symmetry of the outline.
    """
    slider = recording.slider
    pose = np.column_stack([slider.x, slider.y, slider.heading])
    if not len(pose) or _share_of_fixed(slider.stamp, pose) < FIXED_SHARE:
        return None, recording
    turned = HeadingFlips().take(slider.stamp, pose)
    changes = np.diff(turned, prepend=0.0)
    flips = np.round(np.degrees(np.abs(wrap_angle(changes[np.abs(changes) > 1e-6]))))
    if len(flips) < FEWEST:
        return None, recording
    angles, counts = np.unique(flips, return_counts=True)
    listed = " and ".join(f"{angle:.0f}" for angle in angles[counts >= COMMON * len(flips)])
    share = float(np.mean(turned != 0.0))
    sentence = (
        f"The slider's heading flips {len(flips)} times by {listed} degrees while the slider stays in its place "
        f"({100.0 * share:.1f} % of the samples): the markers look alike after such a turn."
    )
    values = {"flips": Value(float(len(flips)), "1"), "share": Value(share, "1")}
    unknown = share > OFTEN and not all(_symmetric(outline, np.radians(angle)) for angle in angles)
    found = Finding("heading_flips", "refused" if unknown else "warning", sentence, ADVICE, values)
    return found, replace(recording, slider=replace(slider, heading=wrap_angle(slider.heading - turned)))


def _symmetric(outline: Outline, turn: float) -> bool:
    """Whether a turn (rad) maps the outline onto itself."""
    turned = rotate(outline.vertices, np.full(len(outline.vertices), turn))
    return bool(np.max(np.abs(outline.project(turned).distance)) < SAME)


def _share_of_fixed(stamp: IntArray, pose: Array) -> float:
    """Share of the steps by a large angle, of a slider that stays, that are fixed angles; 0 without any."""
    turn, elsewhere = flip_steps(stamp, pose)
    large = ~elsewhere & (np.abs(wrap_angle(np.diff(pose[:, 2]))) > LARGE)
    return float(np.mean(turn[large] != 0.0)) if large.any() else 0.0
