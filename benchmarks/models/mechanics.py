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

"""CPU time of the exact forward model: tabulation, many pushes as arrays, and single pushes in plain numbers.

    python -m benchmarks.models.mechanics --windows 1000

For an even patch, a support on three points, and the ellipsoid; textbook parameters and eight fitted ones.
"""

from __future__ import annotations

import argparse
from functools import partial

import numpy as np

from benchmarks.models.training import least_cpu_seconds
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.limit_surfaces.surfaces import PowerSurface
from push_predictor.models.mechanics.pressure import PressureDistribution, supported_at
from push_predictor.models.mechanics.scalar.mechanics import scalar_mechanics
from push_predictor.types import Array

RADIUS = 0.00475  # m
SINGLE = 200  # single pushes that are timed
THREE_POINTS = supported_at(np.array([[0.04, 0.03, 0.3], [-0.04, 0.03, 0.3], [0.0, -0.04, 0.4]]))
SUPPORTS: dict[str, PressureDistribution | PowerSurface | None] = {
    "even patch": None,
    "three points": THREE_POINTS,
    "ellipsoid": PowerSurface(np.zeros(2), 0.034),
}
EIGHT = {
    "contact_friction": 0.25,
    "friction_by_angle": 0.1,
    "centre_x": 0.001,
    "pushing_height": 0.003,
    "tracker_rotation": 0.02,
    "body_anisotropy": 0.1,
    "slope_x": 0.05,
    "gradient_x": 1.0,
}


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--windows", type=int, default=1000, metavar="N", help="of 0.2 s at 20 mm/s (default 1000)")
    n = parser.parse_args(arguments).windows
    print(f"| support | parameters | tabulation | {n} windows | one window: median | mean | 95 % |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name, support in SUPPORTS.items():
        mechanics = PushMechanics(shape_outline("rect1"), RADIUS, support)
        for label, values in (("textbook", {}), ("eight fitted", EIGHT)):
            print(f"| {name} | {label} | {_row(FittedMechanics(mechanics, values), n)} |")
    return 0


def _row(fitted: FittedMechanics, n: int) -> str:
    rng = np.random.default_rng(0)
    inputs = np.column_stack([np.full(n, 0.02), rng.random(n), rng.uniform(-1.2, 1.2, n)])
    duration, heading = np.full(n, 0.2), rng.uniform(-3.0, 3.0, n)

    def displacement(model: FittedMechanics, rows: slice) -> Array:
        return model.displacement(inputs[rows], duration[rows], {"push_heading": heading[rows]})

    first = least_cpu_seconds(lambda: displacement(fitted, slice(0, 1)), 1)
    together = least_cpu_seconds(lambda: displacement(fitted, slice(None)))
    alone = scalar_mechanics(fitted)
    displacement(alone, slice(0, 1))  # takes the table over into plain numbers
    rows = [slice(k, k + 1) for k in range(min(SINGLE, n))]
    single = 1e6 * np.array([least_cpu_seconds(partial(displacement, alone, row)) for row in rows])
    times = f"{np.median(single):.0f} us | {np.mean(single):.0f} us | {np.quantile(single, 0.95):.0f} us"
    return f"{1e3 * first:.0f} ms | {1e3 * together:.1f} ms | {times}"


if __name__ == "__main__":
    raise SystemExit(main())
