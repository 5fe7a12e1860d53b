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

"""Mechanisms from textbook mechanics that can change the outcome of a push: one per module, in one library.

A mechanism computes how an outcome changes with its physical parameter, from the outline and the limit surface. To add
one, write a module with a Mechanism in it and name it in LIBRARY (docs/how_to/new_mechanism.md).
"""

from __future__ import annotations

from push_predictor.models.mechanisms.anisotropic_friction import ANISOTROPIC_FRICTION
from push_predictor.models.mechanisms.body_anisotropy import BODY_ANISOTROPY
from push_predictor.models.mechanisms.centre_of_friction import CENTRE_OF_FRICTION
from push_predictor.models.mechanisms.contact_asymmetry import CONTACT_ASYMMETRY
from push_predictor.models.mechanisms.contact_friction import CONTACT_FRICTION
from push_predictor.models.mechanisms.friction_gradient import FRICTION_GRADIENT
from push_predictor.models.mechanisms.inertia import INERTIA
from push_predictor.models.mechanisms.limit_surface_power import LIMIT_SURFACE_POWER
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.models.mechanisms.pressure_spread import PRESSURE_SPREAD
from push_predictor.models.mechanisms.pusher_radius import PUSHER_RADIUS
from push_predictor.models.mechanisms.pusher_travel import PUSHER_TRAVEL
from push_predictor.models.mechanisms.pushing_height import PUSHING_HEIGHT
from push_predictor.models.mechanisms.refinements import REFINEMENTS
from push_predictor.models.mechanisms.tilted_surface import TILTED_SURFACE

LIBRARY: tuple[Mechanism, ...] = (
    CONTACT_FRICTION,
    CONTACT_ASYMMETRY,
    PRESSURE_SPREAD,
    CENTRE_OF_FRICTION,
    PUSHING_HEIGHT,
    LIMIT_SURFACE_POWER,
    BODY_ANISOTROPY,
    ANISOTROPIC_FRICTION,
    FRICTION_GRADIENT,
    TILTED_SURFACE,
    INERTIA,
    PUSHER_RADIUS,
    PUSHER_TRAVEL,
)

__all__ = ["LIBRARY", "REFINEMENTS", "Mechanism", "Parameter", "Push"]
