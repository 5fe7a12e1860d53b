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

"""How much faster the analytical model predicts many pushes as arrays than one by one in plain numbers.

    python -m benchmarks.models.analytical --windows 1000

Both sides are measured in one run; the figure is their ratio of CPU time.
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.models.training import least_cpu_seconds
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.analytical_scalar import scalar_analytical

RADIUS = 0.00475  # m


def main(arguments: list[str] | None = None) -> int:
    """Print CPU time per window of both, and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--windows", type=int, default=1000, metavar="N", help="of 0.2 s at 20 mm/s (default 1000)")
    n = parser.parse_args(arguments).windows
    model, rng = AnalyticalPush(shape_outline("rect1"), RADIUS), np.random.default_rng(0)
    alone = scalar_analytical(model)
    inputs = np.column_stack([np.full(n, 0.02), rng.random(n), rng.uniform(-1.4, 1.4, n)])
    duration = np.full(n, 0.2)
    together = least_cpu_seconds(lambda: model.displacement(inputs, duration))
    in_turn = least_cpu_seconds(lambda: [alone.displacement(inputs[k : k + 1], duration[k : k + 1]) for k in range(n)])
    print(f"{n} windows as arrays: {1e3 * together:.1f} ms; one by one: {1e6 * in_turn / n:.0f} us each")
    print(f"arrays are {in_turn / together:.1f} times as fast")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
