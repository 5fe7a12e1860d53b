"""A tip thicker or thinner than the rig file states: worn, bent, with a sleeve. It rolls on the side by its radius."""

from __future__ import annotations

from dataclasses import replace

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.types import Array

STEP = 0.001  # m


def response(physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per metre of radius, the contact point being the same, (n, 3, 1)."""
    low, high = max(physics.pusher_radius - STEP, 0.0), physics.pusher_radius + STEP
    more, less = (replace(physics, pusher_radius=r).displacement(push.inputs, push.duration) for r in (high, low))
    return ((more - less) / (high - low))[:, :, None]


PUSHER_RADIUS = Mechanism(
    "pusher_radius", (Parameter("change of the pusher's radius", "m", 0.004),), response, quantities=("radius_error",)
)
