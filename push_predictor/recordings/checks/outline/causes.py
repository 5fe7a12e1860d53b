# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What explains the contacts: a corrected outline alone, a wrong tip, world frames apart, or other proportions.

Each cause is a further parameter of the fit. One is named only where it explains clearly more, by a plausible amount.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from push_predictor.recordings.checks.outline.fit import TIE, OutlineFit, fit_frames, fit_outline_and
from push_predictor.recordings.checks.outline.touches import (
    FRAME_X,
    FRAME_Y,
    FRAME_YAW,
    SIZE,
    STRETCH,
    TIP,
    YAW,
    Contacts,
    X,
    Y,
)
from push_predictor.recordings.rig import Rig

Name: TypeAlias = Literal["outline", "tip_radius", "frames_apart", "proportions"]
DOUBT = 4.0  # standard deviations that an estimate must exceed, in addition to its allowance
LENGTH_ALLOWANCE, ANGLE_ALLOWANCE, LAG_ALLOWANCE = 0.0005, np.radians(1.0), 0.01  # m, rad, s: marker and clock accuracy
SEPARATE = 0.0002  # m; sd of size and tip radius, fitted together, above which the contacts do not separate them
FINE = 0.0001  # m; a spread of the pushes below it leaves nothing to explain
LARGEST_TIP_CHANGE = 0.55  # relative; a diameter given as the radius is a change of 0.5
LARGEST_SIZE_CHANGE = 0.1  # relative
RIGHT_ANGLE = 1e-6  # cosine


@dataclass(frozen=True, eq=False)
class Cause:
    """The cause that explains the contacts, and its fit; rival: a fit of other proportions that explains as much."""

    name: Name
    fit: OutlineFit
    rival: OutlineFit | None = None


def cause_of(contacts: Contacts, rig: Rig, fit: OutlineFit) -> Cause:
    """The cause of the gaps between contacts and outline, from the fit of yaw, shift, size and clock lag alone."""
    if fit.spread < FINE and not is_resized(fit, rig) and not is_moved(fit):
        return Cause("outline", fit)
    axes = _with_axes(contacts, rig, fit)
    known: dict[Name, OutlineFit | None] = {
        "tip_radius": _with_tip(contacts, rig, fit),
        "frames_apart": frames_apart(contacts, rig, fit),
        "proportions": axes if axes is not None and _has_other_proportions(axes, rig) else None,
    }
    tried = {name: each for name, each in known.items() if each is not None}
    least = min([_penalised(fit), *map(_penalised, tried.values())])
    name = next((name for name, each in tried.items() if _penalised(each) <= TIE * least), None)
    if name is None or (name != "tip_radius" and _penalised(fit) <= TIE * _penalised(tried[name])):
        return Cause("outline", fit)
    rival = axes if name == "tip_radius" and axes is not None and axes.cost <= TIE * tried[name].cost else None
    return Cause(name, tried[name], rival)


def frames_apart(contacts: Contacts, rig: Rig, fit: OutlineFit) -> OutlineFit | None:
    """The fit with the world frames of slider and pusher apart, None unless they are and it explains the contacts."""
    apart = fit_frames(rig.outline, rig.pusher_radius, contacts, fit)
    turned = _exceeds(apart, FRAME_YAW, ANGLE_ALLOWANCE)
    shifted = any(_exceeds(apart, each, LENGTH_ALLOWANCE) for each in (FRAME_X, FRAME_Y))
    explained = apart.spread < LENGTH_ALLOWANCE and TIE * _penalised(apart) < _penalised(fit)
    return apart if explained and (turned or shifted) else None


def half_size(rig: Rig) -> float:
    """Distance from the centre to a side, m, of a regular outline with this area and perimeter."""
    return 2.0 * rig.outline.area / rig.outline.perimeter


def is_resized(fit: OutlineFit, rig: Rig) -> bool:
    """Whether the size differs beyond doubt."""
    return _exceeds(fit, SIZE, LENGTH_ALLOWANCE / half_size(rig))


def is_moved(fit: OutlineFit) -> bool:
    """Whether yaw or place differ beyond doubt."""
    return is_turned(fit) or is_shifted(fit)


def is_shifted(fit: OutlineFit) -> bool:
    """Whether the place differs beyond doubt."""
    return _exceeds(fit, X, LENGTH_ALLOWANCE) or _exceeds(fit, Y, LENGTH_ALLOWANCE)


def is_turned(fit: OutlineFit) -> bool:
    """Whether the yaw differs beyond doubt."""
    return _exceeds(fit, YAW, ANGLE_ALLOWANCE)


def is_separate(fit: OutlineFit, rig: Rig) -> bool:
    """Whether the contacts separate size and tip radius, which were fitted together."""
    return fit.sd[SIZE] > 0.0 and max(float(fit.sd[SIZE]) * half_size(rig), float(fit.sd[TIP])) < SEPARATE


def has_two_sizes(rig: Rig) -> bool:
    """Whether the outline is an ellipse or a rectangle: its sizes along two axes may be wrong by different amounts."""
    outline = rig.outline
    if outline.semi_axes is not None:
        return outline.semi_axes[0] != outline.semi_axes[1]
    sides = np.roll(outline.vertices, -1, axis=0) - outline.vertices
    sides = sides / np.linalg.norm(sides, axis=1, keepdims=True)
    along = np.abs(sides).max(axis=1)
    return len(sides) == 4 and bool(np.all(along > 1.0 - RIGHT_ANGLE))


def _with_tip(contacts: Contacts, rig: Rig, fit: OutlineFit) -> OutlineFit | None:
    """With the tip's radius too, if the size is wrong, and the contacts show both, by a plausible amount."""
    if not is_resized(fit, rig):
        return None
    both = fit_outline_and([TIP], rig.outline, rig.pusher_radius, contacts, fit)
    wrong = is_separate(both, rig) and _exceeds(both, TIP, LENGTH_ALLOWANCE)
    return both if wrong and not _is_implausible(both, rig) else None


def _with_axes(contacts: Contacts, rig: Rig, fit: OutlineFit) -> OutlineFit | None:
    if not has_two_sizes(rig) or fit.sd[SIZE] == 0.0:
        return None
    return fit_outline_and([STRETCH], rig.outline, rig.pusher_radius, contacts, fit)


def _is_implausible(fit: OutlineFit, rig: Rig) -> bool:
    """Whether the fitted tip's radius and size are no mistake of measurement."""
    thicker, growth = abs(fit.estimate[TIP]), abs(fit.estimate[SIZE])
    return bool(thicker > LARGEST_TIP_CHANGE * rig.pusher_radius or growth > LARGEST_SIZE_CHANGE)


def _has_other_proportions(axes: OutlineFit, rig: Rig) -> bool:
    return axes.spread < LENGTH_ALLOWANCE and _exceeds(axes, STRETCH, LENGTH_ALLOWANCE / half_size(rig))


def _penalised(fit: OutlineFit) -> float:
    """The mean gap that other pushes would have, by generalised cross-validation with pushes as observations."""
    spare = fit.pushes - np.count_nonzero(fit.sd)
    return fit.cost * fit.pushes / spare if spare > 0 else np.inf


def _exceeds(fit: OutlineFit, parameter: int, allowance: float) -> bool:
    return bool(abs(fit.estimate[parameter]) > DOUBT * fit.sd[parameter] + allowance)
