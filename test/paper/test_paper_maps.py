# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The paper's maps: where outputs are largest, how alike the maps of model and repetitions are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from paper_studies import PLAN, made_up_study, rig_of, verdict_on
from push_predictor_paper.data.repetitions import PATH_POINTS, RepeatedGrid, Repetitions, contact_on_first_side
from push_predictor_paper.fits.fit import Answer
from push_predictor_paper.fits.map_models import ANGLES, FRACTIONS, ModelMap, averaged, reference_maps
from push_predictor_paper.plan import GRID_SPEED
from push_predictor_paper.sections.maps import (
    MIRRORED,
    NAMED,
    Peaks,
    agreement_evidence,
    likenesses,
    peak_evidence,
    peaks_of,
)
from push_predictor_paper.statistics.grid_maps import (
    Peak,
    Place,
    at_places,
    block_weights,
    by_blocks,
    correlation,
    mean_of,
    median_of,
    peak,
    redrawn,
    unbiased,
)

from push_predictor.evaluation.estimate import Estimate, of_draws
from push_predictor.types import Array

GRID = replace(PLAN, contacts=11, angle_step=0.25, repetitions=24)
EVERY = np.ones((1, 3))
Formula = Callable[[Array, Array], Array]  # contact, angle -> (n, 3)


def grid_of(mean: Formula, sd: float = 0.01, spoilt: int = 0) -> RepeatedGrid:
    """Repetitions of a mean by formula, evenly spread about it; the first `spoilt` pushes were hardly seen."""
    rig, spread = rig_of("rect1", "plywood"), np.linspace(-1.7, 1.7, GRID.repetitions)[:, None]
    cells: list[Repetitions] = []
    for fraction in GRID.grid_fractions.tolist():
        for angle in GRID.grid_angles.tolist():
            contact = float(contact_on_first_side(rig.outline, np.array(fraction)))
            outcomes = mean(np.array([fraction]), np.array([angle])) + sd * spread
            outcomes = outcomes[: 3 if len(cells) < spoilt else None]
            inputs = np.tile([GRID_SPEED, contact, angle], (len(outcomes), 1))
            paths = np.zeros((len(outcomes), PATH_POINTS, 3))
            cells.append(Repetitions(fraction, angle, GRID.repetitions, inputs, outcomes, paths))
    return RepeatedGrid("rect1", "plywood", rig, GRID.grid_fractions, GRID.grid_angles, tuple(cells))


def bumps(places: tuple[Place, Place, Place]) -> Formula:
    """Outputs that are 1 at one place each and fall off around it."""

    def mean(contact: Array, angle: Array) -> Array:
        return np.column_stack([np.exp(-20.0 * (contact - c) ** 2 - 4.0 * (angle - a) ** 2) for c, a in places])

    return mean


def on_both_halves(mean: Formula) -> Formula:
    """The same on the mirrored half of the side, as on a square."""
    return lambda contact, angle: mean(contact, angle) + mean(1.0 - contact, -angle)


def model_of(mean: Formula) -> ModelMap:
    """A model that knows the formula."""
    angle, fraction = (part.ravel() for part in np.meshgrid(ANGLES, FRACTIONS, indexing="ij"))
    maps = mean(fraction, angle).reshape(len(ANGLES), len(FRACTIONS), 3)
    return ModelMap(maps, 0.0 * maps + 0.01, 0.0 * maps + 0.01, None)


def as_the_paper_says() -> tuple[Place, Place, Place]:
    """Largest where the paper has it, in our signs."""
    return NAMED["dx"][0], NAMED["dy"][0], NAMED["dtheta"][0]


def verdicts(peaks: Peaks) -> list[str]:
    """On forward, sideways, turning, handedness."""
    return [verdict_on("maps", claim, evidence) for claim, evidence in peak_evidence(peaks).items()]


def test_outputs_that_are_largest_where_the_paper_states() -> None:
    mean = on_both_halves(bumps(as_the_paper_says()))
    peaks = peaks_of(grid_of(mean), [model_of(mean)] * 2)
    assert peaks.repeated[0].place == (0.5, 0.0)
    np.testing.assert_allclose(peaks.learned[0].place, (0.5, 0.0), atol=1e-9)
    assert verdicts(peaks) == ["holds"] * 4


def test_outputs_that_are_largest_elsewhere() -> None:
    mean = bumps(((0.1, 1.0), (0.5, -1.5), MIRRORED[0]))
    assert verdicts(peaks_of(grid_of(mean), [model_of(mean)] * 2)) == ["does not hold"] * 4


def test_a_model_that_disagrees_with_the_repetitions_makes_it_hold_in_part() -> None:
    right = on_both_halves(bumps(as_the_paper_says()))
    wrong = on_both_halves(bumps(((0.1, 1.0), (0.5, -1.5), MIRRORED[0])))
    assert verdicts(peaks_of(grid_of(right), [model_of(wrong)] * 2)) == ["holds in part"] * 4


def test_a_push_close_to_the_largest_counts_in_part_and_an_unobserved_one_does_not() -> None:
    def found(reach: float) -> Peaks:
        return peaks_at([(0.1, 1.0)], Estimate(reach, reach, reach))

    assert verdicts(found(0.95)) == ["holds in part", "holds", "holds in part", "not decided"]
    assert verdicts(found(0.8))[:3] == ["does not hold", "holds in part", "does not hold"]


def peaks_at(places: list[Place], reach: Estimate) -> Peaks:
    """The same by repetitions and by the model, no handedness."""
    one, nothing = Peak(Estimate(1.0, 1.0, 1.0), places[0], tuple(places), reach), Estimate(np.nan, np.nan, np.nan)
    return Peaks((one,) * 3, (one,) * 3, (nothing, nothing))


def test_peak_lists_the_fewest_places_with_95_percent_of_the_draws() -> None:
    axes, shown = (np.array([0.0, 0.5, 1.0]), np.array([-1.0, 0.0, 1.0])), np.zeros((3, 3))
    drawn = np.zeros((100, 3, 3))
    drawn[:90, 1, 1] = drawn[90:96, 0, 2] = drawn[96:, 2, 0] = 1.0
    shown[1, 1] = 1.0
    found = peak(axes[0], axes[1], shown, drawn, [(0.75, 0.0)], of_draws)
    assert found.place == (0.5, 0.0)
    assert found.places == ((0.5, 0.0), (1.0, -1.0))
    assert found.reach.value == 0.5
    steps = found.steps_from([(0.9, -0.9)])  # the places are 9 and 1 steps away
    assert (steps.value, steps.low, steps.high) == pytest.approx((9.0, 1.0, 9.0))


def test_pushes_with_too_few_repetitions_are_never_the_largest() -> None:
    grid = grid_of(bumps(((0.0, -1.5), (0.5, 0.0), (0.5, 0.0))), spoilt=2)
    assert np.isnan(grid.mean[0, 0]).all()
    model = model_of(bumps(as_the_paper_says()))
    assert peaks_of(grid, [model]).repeated[0].place == (0.1, -1.5)


def test_values_of_the_observed_pushes_are_assigned_to_their_places() -> None:
    grid = grid_of(bumps(as_the_paper_says()), spoilt=5)
    np.testing.assert_array_equal(grid.as_map(np.array([cell.mean for cell in grid.seen])), grid.mean)
    means, sds = redrawn(grid.seen)
    assert grid.as_map(means).shape == (len(means), *grid.mean.shape)
    np.testing.assert_allclose(means.mean(axis=0), [cell.mean for cell in grid.seen], atol=0.003)
    np.testing.assert_allclose(sds.mean(axis=0), [cell.sd for cell in grid.seen], rtol=0.05)


def test_maps_are_read_between_their_points() -> None:
    fractions, angles = np.linspace(0.0, 1.0, 5), np.linspace(-1.5, 1.5, 7)
    plane = 2.0 * fractions[None, :] + 3.0 * angles[:, None]
    read = at_places(fractions, angles, np.stack([plane, -plane]), [(0.3, 0.1), (0.8, -1.2)])
    np.testing.assert_allclose(read, [[0.9, -2.0], [-0.9, 2.0]])


def test_means_and_medians_of_weighted_pushes_are_those_of_pushes_written_out() -> None:
    values, weights = np.array([5.0, 1.0, 9.0, 2.0]), np.array([[1.0, 1.0, 1.0, 1.0], [2.0, 0.0, 1.0, 0.0]])
    drawn = [[5.0, 1.0, 9.0, 2.0], [5.0, 5.0, 9.0]]
    np.testing.assert_allclose(mean_of(values, weights), [np.mean(d) for d in drawn])
    np.testing.assert_allclose(median_of(values, weights), [np.median(d) for d in drawn])


def test_the_map_shown_is_the_mean_of_the_draws_maps() -> None:
    one, other = model_of(bumps(as_the_paper_says())), model_of(bumps(((0.1, 1.0), (0.5, -1.5), MIRRORED[0])))
    np.testing.assert_allclose(averaged([one, other]).mean, 0.5 * (one.mean + other.mean))


def test_neighbouring_pushes_are_resampled_together() -> None:
    cells = grid_of(bumps(as_the_paper_says())).cells
    weights = block_weights(cells)
    names = [(round(cell.fraction, 6), round(cell.angle, 6)) for cell in cells]
    one, near, far = (names.index((c, a)) for c, a in ((0.2, 0.0), (0.3, 0.25), (0.6, 0.0)))
    np.testing.assert_array_equal(weights[:, one], weights[:, near])
    assert np.any(weights[:, one] != weights[:, far])


def test_likeness_of_two_maps() -> None:
    one = np.array([1.0, 2.0, 4.0])
    assert correlation(one, 3.0 * one - 7.0, EVERY) == pytest.approx(1.0)
    assert correlation(one, -one, EVERY) == pytest.approx(-1.0)
    assert np.isnan(correlation(np.full(3, 0.2), one, EVERY)).all()
    repeated = np.array([[2.0, 1.0, 0.0]])  # as if the first push were there twice
    assert correlation(one, one**2, repeated) == pytest.approx(1.0)
    assert by_blocks(lambda w: correlation(one, one, w), np.array([[1.0, 1.0, 1.0], [2.0, 1.0, 0.0]])).low == 1.0


def test_removes_the_bias_of_a_noisy_maximum() -> None:
    rng = np.random.default_rng(0)
    seen = rng.standard_normal(300)  # truth: all zero
    found = unbiased(float(seen.max()), (seen + rng.standard_normal((500, 300))).max(axis=1))
    assert found.value < seen.max() and found.low < found.value < found.high


def test_a_model_that_is_the_truth_agrees_and_one_without_shape_does_not() -> None:
    grid = grid_of(bumps(as_the_paper_says()))
    cells = [replace(c, outcomes=c.mean + (1.0 + c.fraction) * (c.outcomes - c.mean)) for c in grid.seen]
    mean, sd = (np.array([getattr(c, name) for c in cells]) for name in ("mean", "sd"))
    known = np.ones(len(cells), dtype=bool)
    flat = 0.0 * sd + 0.01
    answers = {"VHGP": [Answer(mean, sd, sd, known)] * 2, "GP": [Answer(mean, flat, flat, known)]}
    found = likenesses(cells, answers)
    assert np.isnan(found["sd", "GP"][0].value)
    opposite = Answer(mean, sd.max() - sd, sd, known)
    drawn = likenesses(cells, {"VHGP": [Answer(mean, 3.0 * sd, sd, known), opposite]})
    assert drawn["sd", "VHGP"][0].value == pytest.approx(0.0, abs=1e-12)  # of each draw by itself, then the mean
    assert [verdict_on("maps", claim, e) for claim, e in agreement_evidence(found).items()] == ["holds", "holds"]


def test_maps_are_nan_outside_the_training_data(tmp_path: Path) -> None:
    study = made_up_study(tmp_path)
    model = reference_maps(study, "vhgp")[0]
    assert np.isnan(model.mean[0, 0]).all()  # no made-up push is at 1.5 rad
    assert np.isfinite(model.mean[30, 20]).all()
    assert model.at_pushes is not None and len(model.at_pushes.mean) == len(study.reference_grid.seen)
