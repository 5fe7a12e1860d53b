"""A push carried out on many samples of the slider's pose at once, window by window.

The pusher is put at the commanded contact of every sample and then drives straight on in the world: where it touches
in the second and later windows follows from where it is and where the sample has gone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.geometry.frames import wrap_angle
from push_predictor.geometry.touch import displaced
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.tabulated_model import TabulatedModel
from push_predictor.planning.persistence import Persistence, root_of
from push_predictor.planning.push_windows import PushWindows, windows_of
from push_predictor.planning.straight_drive import Meeting, drive_onto
from push_predictor.types import Array, BoolArray

# Covariates that a sample tells; the tip touches, so its gap is none.
OF_THE_POSE = ("slider_x", "slider_y", "slider_heading", "push_heading", "contact_gap")


@dataclass(frozen=True, eq=False)
class Pushed:
    """p samples after a push: sliders (p, 3: x m, y m, heading rad, not wrapped); held (p,), whether the tip pushed
    them in the last window; in_domain (p,), whether all that the model was asked of them lies in its domain.
    """

    sliders: Array
    held: BoolArray
    in_domain: BoolArray


def push_particles(
    predictor: PushModel | TabulatedModel,
    sliders: Array,
    inputs: Array,
    duration: float,
    persistence: Persistence,
    rng: np.random.Generator,
    go_on: Callable[[], None] | None = None,
) -> Pushed:
    """Push sliders (p, 3), each by inputs (p, 3: velocity m/s, contact, angle rad) of its own, for duration s.

    go_on: called before every window. Raises RequestError for a duration that the model cannot answer for; of the rest
    the caller has made sure.
    """
    model = model_of(predictor)
    windows, rig = windows_of(model, duration), model.rig
    drive, meeting = drive_onto(rig.outline, rig.pusher_radius, sliders, inputs)
    deviations = Deviations(persistence, windows.duration * inputs[:, 0], rng)
    in_domain = np.ones(len(sliders), dtype=np.bool_)
    for window in range(windows.count):
        if go_on is not None:
            go_on()
        if window:
            meeting = drive.meet(sliders, meeting, window * windows.duration, windows.duration)
        moved, known = _displacements(predictor, sliders, meeting, windows, deviations.next())
        sliders, in_domain = displaced(sliders, meeting.touch.heading, moved), in_domain & known
    return Pushed(sliders, meeting.held, in_domain)


def model_of(predictor: PushModel | TabulatedModel) -> PushModel:
    """The model itself."""
    return predictor.model if isinstance(predictor, TabulatedModel) else predictor


def refuse_other_covariates(model: PushModel) -> None:
    """Raise RequestError if the model needs what neither a push nor the pose of a slider tells."""
    if foreign := [name for name in model.needs if name not in OF_THE_POSE]:
        accepted = f"a model that needs no covariates but {', '.join(OF_THE_POSE)}: this one needs {', '.join(foreign)}"
        raise RequestError("model", model.name, accepted)


def _displacements(
    predictor: PushModel | TabulatedModel, sliders: Array, meeting: Meeting, windows: PushWindows, deviation: Array
) -> tuple[Array, BoolArray]:
    """Displacements (p, 3) in the push frame, deviation (p, 3) standard ones off the mean, and which are in domain."""
    moved, known = np.zeros((len(sliders), 3)), np.ones(len(sliders), dtype=np.bool_)
    held = np.flatnonzero(meeting.held)
    if not len(held):
        return moved, known
    covariates = {name: column[held] for name, column in _covariates(sliders, meeting.touch.heading).items()}
    asked = np.full(len(held), windows.asked)
    prediction = predictor.predict_rows(meeting.touch.inputs[held], asked, covariates)
    root = root_of(prediction.covariance)
    drawn = prediction.mean + np.einsum("pij,pj->pi", root, deviation[held])
    moved[held] = (windows.scale * meeting.share[held])[:, None] * drawn
    known[held] = prediction.in_domain
    return moved, known


def _covariates(sliders: Array, push_heading: Array) -> dict[str, Array]:
    headings = wrap_angle(sliders[:, 2]), wrap_angle(push_heading)
    values = (sliders[:, 0], sliders[:, 1], *headings, np.zeros(len(sliders)))
    return dict(zip(OF_THE_POSE, values, strict=True))


class Deviations:
    """Standard normal deviations (p, 3) window by window, as persistent as told; way (p,) m of the tips a window."""

    def __init__(self, persistence: Persistence, way: Array, rng: np.random.Generator) -> None:
        self._parts = persistence.lasting, persistence.passing, 1.0 - persistence.lasting - persistence.passing
        self._keeps, self._rng = np.exp(-way[:, None] / persistence.length), rng
        self._lasting, self._passing = rng.standard_normal((2, len(way), 3))

    def next(self) -> Array:
        """Those of the next window; the first call gives the first window's."""
        lasting, passing, new = (np.sqrt(np.maximum(part, 0.0)) for part in self._parts)
        fresh, change = self._rng.standard_normal((2, *self._lasting.shape))
        deviation = lasting * self._lasting + passing * self._passing + new * fresh
        self._passing = self._keeps * self._passing + np.sqrt(1.0 - self._keeps**2) * change
        return np.asarray(deviation)
