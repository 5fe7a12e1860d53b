"""Hartigan's dip: how far a sample is from having one mode (Hartigan and Hartigan 1985; algorithm AS 217).

The dip of a sample is the distance, in share of the sample, of its distribution function from the nearest one that
is convex up to a mode and concave beyond it: between 1 / (2 n) and 1 / 4.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from push_predictor.types import Array, BoolArray, IntArray

CLOSE = 1e-9  # of the range: how far apart equal values are taken to lie
BATCH = 5000
FEW, SMALL = 2000, 0.15  # draws that tell a p value at first, and below which p value all are asked


def dip(samples: Array) -> Array:
    """Dips (b,) of samples (b, n) in any order, n >= 2; exact."""
    x = _distinct(np.sort(samples, axis=1))
    n = x.shape[1]
    before, after = _predecessors(x), n - 1 - _predecessors(-x[:, ::-1])[:, ::-1]
    low, high = np.zeros(len(x), dtype=np.int64), np.full(len(x), n - 1)
    found, rows = np.ones(len(x)), np.arange(len(x))
    while len(rows):  # the modal interval [low, high] shrinks to where the sample is unimodal but for the dip
        left, right, gap, beside = _narrowed(x[rows], before[rows], after[rows], low, high)
        wider = gap > found[rows]
        found[rows] = np.where(wider, np.maximum(found[rows], beside), found[rows])
        go_on = wider & ((left != low) | (right != high))
        rows, low, high = rows[go_on], left[go_on], right[go_on]
    return found / (2.0 * n)


def _narrowed(
    x: Array, before: IntArray, after: IntArray, low: IntArray, high: IntArray
) -> tuple[IntArray, IntArray, Array, Array]:
    """The modal interval within [low, high] (b,), the widest gap between its two hulls, and the dip beside it."""
    rank = np.arange(x.shape[1])
    below, above = _walk(before, high, low), _walk(after, low, high)
    minorant, majorant = _through(x, below), _through(x, above)
    inside = (rank >= low[:, None]) & (rank <= high[:, None])
    gap = np.where(inside & (below | above), majorant - minorant + 1.0, -np.inf)
    widest = len(rank) - 1 - np.argmax(gap[:, ::-1], axis=1)
    left = np.max(np.where(below & (rank <= widest[:, None]), rank, low[:, None]), axis=1)
    right = np.min(np.where(above & (rank >= widest[:, None]), rank, high[:, None]), axis=1)
    convex = np.where(inside & (rank <= left[:, None]), rank - minorant + 1.0, 1.0).max(axis=1)
    concave = np.where(inside & (rank >= right[:, None]), majorant - rank + 1.0, 1.0).max(axis=1)
    return left, right, gap.max(axis=1), np.maximum(convex, concave)


def p_values(dips: Array, n: int, draws: int) -> Array:
    """How often the uniform, the unimodal law hardest to tell from two modes, has a dip as large or larger.

    dips (k,) of samples of size n; against `draws` samples of the uniform: at least 1 / (draws + 1). A p value that
    the first of them put beyond doubt above any level is told by these alone: all draws take seconds for each size.
    """
    p = _share_above(dips, uniform_dips(n, min(draws, FEW)))
    small = p <= SMALL
    if draws > FEW and small.any():
        p[small] = _share_above(dips[small], uniform_dips(n, draws))
    return p


def _share_above(dips: Array, null: Array) -> Array:
    """Of the null's draws (d,), sorted, and the dip itself."""
    return np.asarray((1.0 + len(null) - np.searchsorted(null, dips - 1e-12)) / (len(null) + 1.0))


@cache
def uniform_dips(n: int, draws: int, seed: int = 0) -> Array:
    """Sorted dips (draws,) of samples of size n of the uniform."""
    rng = np.random.default_rng([seed, n])
    sizes = [min(BATCH, draws - begin) for begin in range(0, draws, BATCH)]
    return np.sort(np.concatenate([dip(rng.random((size, n))) for size in sizes]))


def holm(p: Array) -> Array:
    """Holm's (1979) family-wise p values (k,) of p values (k,): what is <= 0.05 holds at once, with 95 % certainty."""
    order = np.argsort(p)
    adjusted = np.maximum.accumulate((len(p) - np.arange(len(p))) * p[order])
    result = np.empty(len(p))
    result[order] = np.minimum(adjusted, 1.0)
    return result


def power(n: int, separation: float, critical: float, draws: int = 1000, seed: int = 0) -> float:
    """Share of samples of two equal normal modes, `separation` of their sd apart, whose dip reaches `critical`."""
    return float(np.mean(_two_mode_dips(n, separation, draws, seed) >= critical))


@cache
def _two_mode_dips(n: int, separation: float, draws: int, seed: int) -> Array:
    rng = np.random.default_rng([seed, n, round(1e3 * separation)])
    return dip(rng.standard_normal((draws, n)) + separation * rng.integers(0, 2, (draws, n)))


def _distinct(x: Array) -> Array:
    """Rows sorted and strictly increasing."""
    tied = np.any(np.diff(x, axis=1) <= 0.0, axis=1)
    span = x[:, -1:] - x[:, :1]
    step = np.where(span > 0.0, CLOSE * span, 1.0)
    return np.where(tied[:, None], x + step * np.arange(x.shape[1]), x)


def _predecessors(x: Array) -> IntArray:
    """Vertex (b, n) before each point on the greatest convex minorant of the points (x, rank) up to it."""
    result = np.zeros(x.shape, dtype=np.int64)
    for j in range(1, x.shape[1]):
        vertex, rows = np.full(len(x), j - 1), np.arange(len(x))
        while j > 1 and len(rows):  # a vertex above the line from the one before it to the new point is none
            last = vertex[rows]
            first = result[rows, last]
            begin, middle, end = x[rows, first], x[rows, last], x[rows, j]
            hidden = (last > 0) & ((last - first) * (end - begin) >= (j - first) * (middle - begin))
            rows = rows[hidden]
            vertex[rows] = first[hidden]
        result[:, j] = vertex
    return result


def _walk(following: IntArray, start: IntArray, end: IntArray) -> BoolArray:
    """Which points (b, n) are met from start to end (b,)."""
    met, place, rows = np.zeros(following.shape, dtype=np.bool_), start, np.arange(len(start))
    met[rows, place] = True
    while np.any(place != end):
        place = np.where(place == end, end, following[rows, place])
        met[rows, place] = True
    return met


def _through(x: Array, vertices: BoolArray) -> Array:
    """Rank (b, n) of the polygon through the vertices, at every point; constant beyond its ends."""
    n = x.shape[1]
    rank = np.arange(n)
    previous = np.maximum.accumulate(np.where(vertices, rank, -1), axis=1)
    following = np.minimum.accumulate(np.where(vertices, rank, n)[:, ::-1], axis=1)[:, ::-1]
    previous, following = np.where(previous < 0, following, previous), np.where(following == n, previous, following)
    rows = np.arange(len(x))[:, None]
    begin, width = x[rows, previous], x[rows, following] - x[rows, previous]
    share = np.divide(x - begin, width, out=np.zeros(x.shape), where=width > 0.0)
    return np.asarray(previous + share * (following - previous))
