# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Updates of the posterior by pushes: the same as conditioning a Gaussian on their outcomes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from push_predictor.design.information import Information, greedy
from push_predictor.types import Array

C, K, Q, M = 6, 4, 5, 7


@pytest.fixture
def parts() -> tuple[Array, Array, Array]:
    """Features and noise of candidates, features of what matters."""
    rng = np.random.default_rng(0)
    root = rng.standard_normal((C, K, K))
    return rng.standard_normal((C, K, Q)), root @ root.transpose(0, 2, 1) + np.eye(K), rng.standard_normal((M, Q))


def left_over(parts: tuple[Array, Array, Array], chosen: list[int]) -> Array:
    """Posterior covariance of the weights after the outcomes of some candidates, in information form."""
    features, noise, _ = parts
    precision = np.eye(Q)
    for k in chosen:
        precision += features[k].T @ np.linalg.inv(noise[k]) @ features[k]
    return np.linalg.inv(precision)


def loss(parts: tuple[Array, Array, Array], chosen: list[int]) -> float:
    return float(0.5 * np.mean(np.log1p(variances(parts, chosen))))


def variances(parts: tuple[Array, Array, Array], chosen: list[int]) -> Array:
    return np.asarray(np.diag(parts[2] @ left_over(parts, chosen) @ parts[2].T))


def test_before_any_push_all_variance_is_left(parts: tuple[Array, Array, Array]) -> None:
    assert Information(*parts).variance == pytest.approx(np.sum(parts[2] ** 2) / M)


def test_each_gain_is_the_fall_of_the_loss_when_that_push_is_known(parts: tuple[Array, Array, Array]) -> None:
    expected = [loss(parts, []) - loss(parts, [k]) for k in range(C)]
    np.testing.assert_allclose(Information(*parts).gains(), expected)


def test_updates_in_turn_equal_conditioning_on_all(parts: tuple[Array, Array, Array]) -> None:
    found = Information(*parts)
    for chosen in ([2], [2, 5], [2, 5, 2]):
        found.observe(chosen[-1])
        assert found.variance == pytest.approx(np.mean(variances(parts, chosen)))
        covariance = left_over(parts, chosen)
        np.testing.assert_allclose(found.covariance, parts[0] @ covariance @ parts[0].transpose(0, 2, 1))
        expected = [loss(parts, chosen) - loss(parts, [*chosen, k]) for k in range(C)]
        np.testing.assert_allclose(found.gains(), expected)


def test_the_greedy_batch_takes_the_largest_gain_each_time(parts: tuple[Array, Array, Array]) -> None:
    order, left = greedy(Information(*parts), 4)
    chosen: list[int] = []
    for k, after in zip(order.tolist(), left, strict=True):
        best = min(range(C), key=lambda other: loss(parts, [*chosen, other]))
        assert k == best
        chosen.append(k)
        assert after == pytest.approx(np.mean(variances(parts, chosen)))


def test_the_gain_of_a_candidate_may_count_less(parts: tuple[Array, Array, Array]) -> None:
    gains, factor = Information(*parts).gains(), np.ones(C)
    best = int(np.argmax(gains))
    factor[best] = 0.99 * np.sort(gains)[-2] / gains[best]
    assert greedy(Information(*parts), 1)[0][0] == best
    assert greedy(Information(*parts), 1, factor=lambda order: factor)[0][0] == np.argsort(gains)[-2]


def test_by_how_much_a_gain_counts_may_depend_on_those_chosen_before(parts: tuple[Array, Array, Array]) -> None:
    asked: list[list[int]] = []

    def factor(order: Sequence[int]) -> Array:
        asked.append(list(order))
        return np.ones(C)

    order = greedy(Information(*parts), 3, factor=factor)[0].tolist()
    assert asked == [[], order[:1], order[:2]]


def test_the_batch_begins_with_given_candidates_and_counts_their_outcomes(parts: tuple[Array, Array, Array]) -> None:
    order, left = greedy(Information(*parts), 3, [4, 1])
    assert order[:2].tolist() == [4, 1]
    assert order[2] == min(range(C), key=lambda other: loss(parts, [4, 1, other]))
    assert greedy(Information(*parts), 3, [4, None, 1])[0].tolist() == [
        4,
        min(range(C), key=lambda other: loss(parts, [4, other])),
        1,
    ]
    assert left[1] == pytest.approx(np.mean(variances(parts, [4, 1])))


def test_a_long_batch_can_be_cancelled(parts: tuple[Array, Array, Array]) -> None:
    asked: list[int] = []

    def check_cancelled() -> None:
        asked.append(len(asked))
        if len(asked) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        greedy(Information(*parts), 5, check_cancelled=check_cancelled)
    assert len(asked) == 3
