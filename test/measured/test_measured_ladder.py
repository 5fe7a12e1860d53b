"""The residual loop on measured pushes finds what the recordings differ in: their names tell us, nobody tells it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.measured.ladder import climb, mlab, named

EVEN = 0.0451  # m: mean distance from the centre of an even triangle
# Mean distance (m) of the support points from the centre, by recording; 2 and 6 lay flat.
SPREAD = {0: 0.0785, 1: 0.0392, 3: 0.0589, 4: 0.0168, 5: 0.0392}


def test_the_first_step_on_mlab_is_the_support_of_each_recording(measured_data: Path, tmp_path: Path) -> None:
    _, step = climb(mlab(measured_data, tmp_path), most_tries=1)
    assert named(step) == "pressure_spread by recording (category)"
    assert not step.refused
    assert step.effect is not None
    found = step.effect.coefficients[list(SPREAD)]
    truth = np.log(np.array(list(SPREAD.values())) / EVEN)
    assert np.array_equal(np.sign(found), np.sign(truth))
    assert np.corrcoef(found, truth)[0, 1] > 0.95
    assert found == pytest.approx(0.65 * truth, abs=0.12)  # first order: large changes come out too small
