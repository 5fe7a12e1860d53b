# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Simulate one push on many samples of the slider's pose, window by window.

The pusher starts at the commanded contact of every sample and moves in a straight line in the world. In later windows
the contact follows from the positions of the pusher and of the sample. The windows have the duration that the model was
trained on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from push_predictor.errors import RequestError, TooLargeError
from push_predictor.geometry.frames import wrap_angle
from push_predictor.geometry.touch import displaced
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.tabulated_model import TabulatedModel
from push_predictor.planning.persistence import Persistence, root_of
from push_predictor.planning.straight_drive import TipContact, start_drive
from push_predictor.types import Array, BoolArray

# Covariates known from the pose. The tip is in contact, so the gap is zero.
POSE_COVARIATES = ("slider_x", "slider_y", "slider_heading", "push_heading", "contact_gap")


@dataclass(frozen=True, eq=False)
class PushedSamples:
    """p samples after a push.

    sliders (p, 3): x m, y m, heading rad, not wrapped; in_contact (p,): whether the tip pushed them in the last window;
    in_domain (p,): whether all requests to the model were in its domain.
    """

    sliders: Array
    in_contact: BoolArray
    in_domain: BoolArray


def push_particles(
    predictor: PushModel | TabulatedModel,
    sliders: Array,
    inputs: Array,
    duration: float,
    persistence: Persistence,
    rng: np.random.Generator,
    check_cancelled: Callable[[], None] | None = None,
    covariates: Mapping[str, float] = MappingProxyType({}),
) -> PushedSamples:
    """Push sliders (p, 3), each by inputs (p, 3: velocity m/s, contact, angle rad) of its own, for duration s.

    check_cancelled is called before every window and may raise. covariates: by name, those that the model needs and the
    poses do not give, the same in all windows. Raises RequestError for a duration that the model cannot answer for; the
    caller has checked everything else.
    """
    model = model_of(predictor)
    windows, rig = windows_of(model, duration), model.rig
    drive, contact = start_drive(rig.outline, rig.pusher_radius, sliders, inputs)
    deviations = Deviations(persistence, windows.duration * inputs[:, 0], rng)
    in_domain = np.ones(len(sliders), dtype=np.bool_)
    for window in range(windows.count):
        if check_cancelled is not None:
            check_cancelled()
        if window:
            contact = drive.contact_at(sliders, contact, window * windows.duration, windows.duration)
        moved, known = sampled_displacements(predictor, sliders, contact, windows, deviations.next(), covariates)
        sliders, in_domain = displaced(sliders, contact.touch.heading, moved), in_domain & known
    return PushedSamples(sliders, contact.in_contact, in_domain)


def model_of(predictor: PushModel | TabulatedModel) -> PushModel:
    """Return the model of a predictor."""
    return predictor.model if isinstance(predictor, TabulatedModel) else predictor


def sampled_displacements(
    predictor: PushModel | TabulatedModel,
    sliders: Array,
    contact: TipContact,
    windows: PushWindows,
    deviation: Array,
    given: Mapping[str, float] = MappingProxyType({}),
) -> tuple[Array, BoolArray]:
    """Displacements (p, 3) of a window in the push frame for standard deviates (p, 3); which are in the domain.

    given: the covariates that the poses do not give, see push_particles.
    """
    moved, known = np.zeros((len(sliders), 3)), np.ones(len(sliders), dtype=np.bool_)
    in_contact = np.flatnonzero(contact.in_contact)
    if not len(in_contact):
        return moved, known
    of_poses = {name: column[in_contact] for name, column in _covariates(sliders, contact.touch.heading).items()}
    covariates = {**{name: np.full(len(in_contact), value) for name, value in given.items()}, **of_poses}
    asked = np.full(len(in_contact), windows.asked)
    prediction = predictor.predict_rows(contact.touch.inputs[in_contact], asked, covariates)
    root = root_of(prediction.covariance)
    drawn = prediction.mean + np.einsum("pij,pj->pi", root, deviation[in_contact])
    moved[in_contact] = (windows.scale * contact.share[in_contact])[:, None] * drawn
    known[in_contact] = prediction.in_domain
    return moved, known


def _covariates(sliders: Array, push_heading: Array) -> dict[str, Array]:
    headings = wrap_angle(sliders[:, 2]), wrap_angle(push_heading)
    values = (sliders[:, 0], sliders[:, 1], *headings, np.zeros(len(sliders)))
    return dict(zip(POSE_COVARIATES, values, strict=True))


class Deviations:
    """Standard normal deviates (p, 3) per window, correlated along the push; step (p,): m of the tip's path."""

    def __init__(self, persistence: Persistence, step: Array, rng: np.random.Generator) -> None:
        self._persistence, self._step, self._rng = persistence, step, rng
        self._persistent, self._decaying = rng.standard_normal((2, len(step), 3))

    def next(self) -> Array:
        """Draw the deviates of the next window; the first call draws those of the first window."""
        fresh, change = self._rng.standard_normal((2, *self._persistent.shape))
        deviation = self._persistence.deviates(self._persistent, self._decaying, fresh)
        self._decaying = self._persistence.decayed(self._decaying, self._step, change)
        return deviation


MOST_WINDOWS = 10_000


@dataclass(frozen=True)
class PushWindows:
    """Equal windows of a push.

    duration (s): of each window; asked (s): the duration passed to the model; scale: factor on its displacements.
    """

    count: int
    duration: float
    asked: float
    scale: float


def windows_of(model: PushModel, duration: float) -> PushWindows:
    """Divide a push of that duration (s) into windows. Raises RequestError if no number of windows suits the model.

    A learnt model predicts its training duration; displacements are scaled in proportion within its tolerance. The
    analytical model predicts any duration; it gets windows of about its training duration, to which its covariance
    applies.
    """
    if not (np.isfinite(duration) and duration > 0.0):
        raise RequestError("duration", duration, "a finite number above 0, in s")
    usual = model.usual_duration
    if duration > MOST_WINDOWS * usual:
        raise TooLargeError("duration", duration, f"at most {MOST_WINDOWS * usual:g} s, {MOST_WINDOWS} windows")
    if not model.predictor.learnt:
        count = max(1, round(duration / usual))
        return PushWindows(count, duration / count, duration / count, 1.0)
    low, high = model.duration_range
    fewest, most = int(np.ceil(duration / high * (1.0 - 1e-12))), int(duration / low * (1.0 + 1e-12))
    if fewest > most:
        raise RequestError("duration", duration, f"{low:.3g} to {high:.3g} s, or a multiple of such a duration")
    count = min(max(round(duration / usual), fewest), most)
    return PushWindows(count, duration / count, usual, duration / count / usual)
