# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The forms in which an effect may depend on each kind of covariate, and the places of a step."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from made_up_traces import pushes

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.residuals.channels.contrast import MOST_NEAR, step_places_near
from push_predictor.residuals.evidence.drivers import STEPS, forms_of, step_places

TABLE = pushes(60, 2)


def forms(covariate: str) -> Counter[tuple[str, bool]]:
    """Names of the forms, and whether each has an offset, with their numbers."""
    return Counter((form.name, form.offset) for form in forms_of(covariate, TABLE))


def starts(form: DriverBasis) -> float:
    """The largest value of a form at the least value of its covariate."""
    values, covariate = form.values(TABLE.covariates, len(TABLE)), TABLE.covariates[form.drivers[0]]
    return float(np.abs(values[covariate == covariate.min()]).max())


def test_a_category_may_have_any_size_at_every_level() -> None:
    (form,) = forms_of("edge", TABLE)
    assert (form.name, form.offset, form.levels) == ("category", True, (0.0, 1.0, 2.0, 3.0))


@pytest.mark.parametrize("heading", ["slider_heading", "push_heading"])
def test_of_a_heading_it_is_periodic(heading: str) -> None:
    assert forms(heading) == {("periodic", True): 1, ("periodic, twice around", True): 1}


@pytest.mark.parametrize("covariate", ["elapsed_time", "push_index"])
def test_along_what_only_grows_it_sets_in_grows_or_is_a_line(covariate: str) -> None:
    expected = {("step", False): STEPS, ("linear", False): 1, ("logarithmic", False): 2, ("linear", True): 1}
    assert forms(covariate) == expected


def test_along_another_covariate_it_may_be_curved_too() -> None:
    table = pushes(60, 2)
    del table.covariates["slider_y"]
    found = Counter((form.name, form.offset) for form in forms_of("slider_x", table))
    assert found["quadratic", True] == 1 and found["step", False] == STEPS and found["logarithmic", False] == 1
    assert not found["map", True]


def test_along_the_place_it_may_be_a_map() -> None:
    assert forms("slider_x")["map", True] == forms("slider_y")["map", True] == 1


def test_without_an_offset_it_is_nothing_at_the_start() -> None:
    for form in forms_of("elapsed_time", TABLE):
        assert (starts(form) > 0.0) == form.offset, form


def test_one_growth_levels_off_far_sooner_than_the_other() -> None:
    late, soon = (form for form in forms_of("elapsed_time", TABLE) if form.name == "logarithmic")
    early = TABLE.covariates["elapsed_time"] <= 200.0
    half = [f.values(TABLE.covariates, len(TABLE))[early].max() / f.values(TABLE.covariates, len(TABLE)).max()
            for f in (late, soon)]  # fmt: skip
    assert half[0] < 0.4 and half[1] > 0.55


def test_places_of_a_step_lie_between_values_and_divide_the_windows_evenly() -> None:
    values = np.repeat(np.random.default_rng(0).normal(size=200), 3)
    places = step_places(values)
    assert len(places) == STEPS and not set(places) & set(values)
    shares = [float(np.mean(values < place)) for place in places]
    np.testing.assert_allclose(shares, np.arange(1, STEPS + 1) / (STEPS + 1.0), atol=0.02)


@pytest.mark.parametrize(
    ("values", "places"), [([4.0, 4.0], []), ([4.0, 5.0, 5.0], [4.5]), ([1.0, 2.0, 4.0], [1.5, 3.0])]
)
def test_few_values_have_few_places(values: list[float], places: list[float]) -> None:
    assert step_places(np.array(values)) == places


def test_near_a_place_are_all_places_between_its_neighbours() -> None:
    values = np.arange(100.0)
    tried = step_places(values)
    near = step_places_near(values, tried[3], 60)
    assert near == [v + 0.5 for v in range(100) if tried[2] < v + 0.5 < tried[4]]
    assert min(step_places_near(values, tried[0], 60)) == 0.5
    assert max(step_places_near(values, tried[-1], 60)) == 98.5


def test_not_more_places_are_tried_near_another_than_the_most() -> None:
    values = np.arange(3000.0)
    near = step_places_near(values, step_places(values)[4])
    assert 0.5 * MOST_NEAR < len(near) <= MOST_NEAR
