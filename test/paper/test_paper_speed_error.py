# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Error against speed: held-out windows whose errors are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from paper_studies import made_up_corpus, made_up_study, verdict_on
from push_predictor_paper.section import TooFewError
from push_predictor_paper.sections.speed_error import (
    FEWEST_PUSHES,
    HeldOut,
    captured,
    joined,
    push_speeds,
    rank_correlation,
    section,
    spearman,
    speed_groups,
    unreliable,
    within_nmse,
)
from scipy.stats import spearmanr

from push_predictor.evaluation.splits import push_bootstrap

SPEEDS = np.array([0.02, 0.1, 0.2, 0.4])
PUSHES = 60  # at each speed


def windows(analytical=(0.1, 0.1, 0.1, 0.1), vhgp=(0.1, 0.1, 0.1, 0.1)) -> HeldOut:
    """One window a push; the models' NMSE within each of four speeds is about so much for each output."""
    rng = np.random.default_rng(1)
    group = np.repeat(np.arange(4), PUSHES)
    speed = SPEEDS[group]
    observed = rng.standard_normal((len(group), 3)) * speed[:, None]

    noise = rng.standard_normal(observed.shape) * speed[:, None]  # the same for all kinds

    def off(nmse) -> np.ndarray:
        return observed - np.sqrt(np.asarray(nmse)[group])[:, None] * noise

    names = np.array([f"p{k:04d}" for k in range(len(group))])
    predicted = {"analytical": off(analytical), "gp": off(vhgp), "vhgp": off(vhgp)}
    return HeldOut(500, names, speed, group, SPEEDS, observed, predicted)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("nmse", "verdict"), [((0.01, 0.1, 0.5, 1.0), "holds"), ((1.0, 0.5, 0.1, 0.01), "does not hold")]
)
def test_unreliable_at_speed_means_that_error_and_speed_are_ranked_alike(nmse, verdict):
    held = windows(nmse)
    assert verdict_on("speed_error", "unreliable", unreliable(held)) == verdict


def test_growth_at_high_speed_alone_holds_in_part():
    held = windows((1.0, 0.02, 0.2, 0.8))
    assert verdict_on("speed_error", "unreliable", unreliable(held)) == "holds in part"


def test_resampled_rank_correlations_are_those_of_repeated_pairs():
    rng = np.random.default_rng(0)
    error, speed = np.round(rng.standard_normal(30), 1), rng.integers(0, 4, 30).astype(float)
    weights = rng.multinomial(30, np.full(30, 1.0 / 30.0), size=5)
    repeated = [spearmanr(np.repeat(error, w), np.repeat(speed, w)).statistic for w in weights]
    np.testing.assert_allclose(spearman(error, speed, weights.astype(float)), repeated)


def test_the_rank_correlation_knows_no_units_of_speed_s_spread():
    even = rank_correlation(windows((0.3, 0.3, 0.3, 0.3)), "analytical")
    assert even.low < 0.0 < even.high


@pytest.mark.parametrize(
    ("vhgp", "verdict"),
    [
        ((0.5, 0.1, 0.1, 0.1), "holds"),
        ((0.5, 0.5, 0.1, 0.1), "holds in part"),
        ((0.5, 2.0, 2.0, 2.0), "does not hold"),
        ((0.5, 0.5, 0.5, 0.5), "not decided"),
    ],
)
def test_models_with_speed_must_lead_at_every_high_speed(vhgp, verdict):
    assert verdict_on("speed_error", "captured", captured(windows((0.5,) * 4, vhgp))) == verdict


def test_levelled_outcomes_have_the_same_spread_at_every_speed():
    level = windows().levelled()
    assert [level.at(k).observed.std() for k in range(4)] == pytest.approx([1.0] * 4)
    assert within_nmse(level.at(3), ("vhgp",)).value == pytest.approx(within_nmse(windows().at(3), ("vhgp",)).value)


def test_slow_pushes_alone_decide_nothing_about_high_speed():
    assert verdict_on("speed_error", "captured", captured(replace(windows(), speeds=SPEEDS[:1]))) == "not decided"


def test_the_nmse_within_a_speed_is_measured_by_the_spread_at_that_speed():
    held = windows()
    observed = held.observed
    wrong = replace(held, predicted={**held.predicted, "gp": np.zeros_like(observed) + observed[:PUSHES].mean(axis=0)})
    assert within_nmse(wrong.at(0), ("gp",)).value == pytest.approx(3.0)


def test_resampled_pushes_are_measured_by_their_own_spread():
    at = windows().at(0)
    error, observed = at.error("gp"), at.observed
    drawn = []
    for weight in push_bootstrap(at.push_id):  # a window each
        rows = np.repeat(np.arange(len(observed)), weight.astype(int))
        drawn.append((error[rows].mean(axis=0) / observed[rows].var(axis=0)).sum())
    found = within_nmse(at, ("gp",))
    np.testing.assert_allclose([found.low, found.high], np.quantile(drawn, [0.025, 0.975]))


def test_the_difference_of_two_kinds_is_that_of_their_figures():
    at = windows((0.5,) * 4, (0.1,) * 4).at(2)
    each = [within_nmse(at, (kind,)).value for kind in ("analytical", "vhgp")]
    assert within_nmse(at, ("analytical", "vhgp")).value == pytest.approx(each[1] - each[0])


def test_speeds_near_one_command_form_one_group():
    command = np.repeat([0.02, 0.05, 0.4], 20)
    measured = command * np.random.default_rng(0).uniform(0.97, 1.03, 60)
    group = speed_groups(np.array([f"p{k}" for k in range(60)]), measured)
    assert np.array_equal(group, np.repeat([0, 1, 2], 20))


def test_speeds_of_few_pushes_join_their_neighbours():
    group = np.repeat([0, 1, 2, 3], [3, 6, FEWEST_PUSHES, 2])
    pushes = np.array([f"p{k}" for k in range(len(group))])
    assert np.array_equal(joined(group, pushes), np.repeat([0, 1], [9, FEWEST_PUSHES + 2]))


def test_a_push_has_one_speed():
    assert push_speeds(np.array(["a", "a", "a", "b"]), np.array([0.1, 0.2, 0.4, 0.3])) == pytest.approx(
        [0.2] * 3 + [0.3]
    )


def test_a_set_of_one_speed_gets_a_note(tmp_path):
    study = replace(made_up_study(tmp_path), simulated=made_up_corpus(speeds=(0.02,)))
    with pytest.raises(TooFewError, match="one speed only"):
        section(study, study.simulated)
