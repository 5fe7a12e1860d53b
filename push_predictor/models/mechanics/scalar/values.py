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

"""The values of the mechanics' parameters, sorted by what a single push does with them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

from push_predictor.models.mechanics.parameters import BY_NAME

Two: TypeAlias = tuple[float, float]

TEXTBOOK_FRICTION = BY_NAME["contact_friction"].textbook


class RecordingErrors(NamedTuple):
    """By how much a recording is wrong: see parameters, part measurement."""

    along: float
    clock_delay: float
    across: float
    outline: Two
    rotation: float
    radius: float


NO_ERRORS = RecordingErrors(0.0, 0.0, 0.0, (0.0, 0.0), 0.0, 0.0)


class Friction(NamedTuple):
    """Contact friction, the difference of its two sides, and how it changes with angle, speed and load."""

    usual: float
    difference: float
    by_angle: float
    by_speed: float
    by_load: float


class World(NamedTuple):
    """Vectors that act in the body (stretch) or in the world: see parameters."""

    stretch: Two
    grain: Two
    slope: Two
    gradient: Two


class ScalarValues(NamedTuple):
    """All values. errors: None for a recording without. same_friction: whether it stays the same along a push."""

    errors: RecordingErrors | None
    push_rotation: float
    travel_share: float
    friction: Friction
    same_friction: bool
    centre: Two
    height: float
    world: World


def scalar_values(values: Mapping[str, float]) -> ScalarValues:
    """The values by name, sorted; a name that is missing has its textbook value."""
    value = values.get
    errors = RecordingErrors(
        value("tip_offset_along", 0.0),
        value("clock_delay", 0.0),
        value("tip_offset_across", 0.0),
        (value("outline_x", 0.0), value("outline_y", 0.0)),
        value("tracker_rotation", 0.0),
        value("radius_error", 0.0),
    )
    changes = value("friction_by_angle", 0.0), value("friction_by_speed", 0.0), value("friction_by_load", 0.0)
    friction = value("contact_friction", TEXTBOOK_FRICTION), value("friction_difference", 0.0)
    return ScalarValues(
        None if errors == NO_ERRORS else errors,
        value("push_rotation", 0.0),
        value("travel_share", 0.0),
        Friction(*friction, *changes),
        changes == (0.0, 0.0, 0.0),
        (value("centre_x", 0.0), value("centre_y", 0.0)),
        value("pushing_height", 0.0),
        World(
            (value("body_anisotropy", 0.0), value("body_anisotropy_diagonal", 0.0)),
            (value("grain_x", 0.0), value("grain_diagonal", 0.0)),
            (value("slope_x", 0.0), value("slope_y", 0.0)),
            (value("gradient_x", 0.0), value("gradient_y", 0.0)),
        ),
    )
