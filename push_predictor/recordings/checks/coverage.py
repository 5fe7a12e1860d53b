# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The part of the domain that pushes cover, by number, side, speed, angle and sliding; how contacts fit the outline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import to_body
from push_predictor.geometry.outline import Outline
from push_predictor.recordings.checks.finding import Finding, Severity, Value
from push_predictor.recordings.checks.motion import Motion
from push_predictor.recordings.dropouts import longest_interval
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, IntArray

FEWEST_PUSHES, GOOD_PUSHES = 8, 30  # fewer than the first give a warning, fewer than the second a note
NARROWEST_ANGLES, GOOD_ANGLES = np.radians(30.0), np.radians(60.0)  # range of the middle 90 %
ONE_SPEED = 1.5  # ratio of the speeds of the middle 90 %
LEAST_SLIDING, GOOD_SLIDING = 0.05, 0.15  # share of steps in which the contact slides
SLIP = 0.2  # of the tip's path: a contact that moves farther along the edge slides
LARGEST_SLIP = 1.5  # of the tip's path: rows with more are not consecutive
FEWEST_STEPS = 20  # from one window of a push to the next
MOST_SIDES = 12  # an outline with more vertices is divided into quarters
MIDDLE = (5.0, 95.0)  # percentiles
OFF = 0.001  # m from the outline
MEANING = "The results are valid only for the part of the domain that was pushed."


@dataclass(frozen=True, eq=False)
class Coverage:
    """What a push table covers.

    side_counts (k,): windows on each side, counter-clockwise from the outline's first vertex, or on each quarter of the
    perimeter; None without an outline. side: "side" or "quarter". alike: the number of sides after which the outline
    repeats, 0 for a circle. speeds m/s and angles rad: middle 90 %. sliding: share of the steps from one window of a
    push to the next in which the contact slides along the edge, None if they are few.
    """

    pushes: int
    windows: int
    side_counts: IntArray | None
    side: str
    alike: int
    speeds: tuple[float, float]
    angles: tuple[float, float]
    sliding: float | None

    def record(self) -> dict[str, object]:
        """The entry in the JSON."""
        return {
            "pushes": self.pushes,
            "windows": self.windows,
            "windows_by_side": None if self.side_counts is None else self.side_counts.tolist(),
            "speeds": list(self.speeds),
            "angles": list(self.angles),
            "sliding_share": self.sliding,
        }


def coverage_of(table: PushTable, rig: Rig | None = None) -> Coverage | None:
    """The coverage of a table, None without a row. Sides and sliding contacts need the rig."""
    if not len(table):
        return None
    speeds, angles = _middle(table.inputs[:, 0]), _middle(table.inputs[:, 2])
    if rig is None:
        return Coverage(len(table.pushes), len(table), None, "side", 0, speeds, angles, None)
    order, (index, count, side) = rig.outline.rotational_symmetry, sides_of(rig.outline, table.inputs[:, 1])
    alike = 0 if order == 0 else count // order if count % order == 0 else count
    counts = np.bincount(index, minlength=count)
    return Coverage(len(table.pushes), len(table), counts, side, alike, speeds, angles, _sliding(table, rig))


def coverage_findings(coverage: Coverage | None) -> list[Finding]:
    """What the pushes lack for a model that learns from them alone, and what to record next."""
    if coverage is None:
        sentence = "No push was found: nothing can be learnt."
        return [Finding("no_pushes", "warning", sentence, "Check topics, outline and clocks, and record pushes.")]
    found = [_pushes(coverage), _missing_sides(coverage), _speeds(coverage), _angles(coverage), _slides(coverage)]
    return [finding for finding in found if finding is not None]


def pushed_part(table: PushTable, rig: Rig | None = None) -> list[Finding]:
    """A warning that states what a table of windows leaves out of the domain; none if it covers enough.

    The limits are those of the warnings of `push_predictor check`. Sides and sliding contacts need the rig.
    """
    coverage = coverage_of(table, rig)
    if coverage is None:
        return []
    lacking = [finding for finding in coverage_findings(coverage) if finding.severity == "warning"]
    few = f"{_contained(coverage)} only."  # without what a learnt model needs
    sentences = [few if finding.name == "few_pushes" else finding.sentence for finding in lacking]
    return [Finding("pushed_part", "warning", " ".join(sentences), MEANING)] if sentences else []


def sides_of(outline: Outline, contact: Array) -> tuple[IntArray, int, str]:
    """Index (n,) of the side of each contact (n,), the number of sides, and their name: side, or quarter."""
    if outline.semi_axes is None and len(outline.vertices) <= MOST_SIDES:
        return outline.edge(contact)[0], len(outline.vertices), "side"
    return np.floor(4.0 * contact).astype(np.int64), 4, "quarter"


def _sliding(table: PushTable, rig: Rig) -> float | None:
    """Share of sliding steps. A contact that sticks moves along the edge only as the slider rolls around the tip."""
    path = table.inputs[:-1, 0] * table.duration[:-1]
    step = np.diff(table.inputs[:, 1])
    slip = np.abs(rig.outline.perimeter * (step - np.round(step)) + rig.pusher_radius * table.outcomes[:-1, 2]) / path
    used = (table.push_id[1:] == table.push_id[:-1]) & (slip < LARGEST_SLIP)
    if (time := table.covariates.get("elapsed_time")) is not None:
        used &= np.abs(np.diff(time) - table.duration[:-1]) < 0.1 * table.duration[:-1]  # windows end to end
    return float(np.mean(slip[used] > SLIP)) if np.sum(used) >= FEWEST_STEPS else None


def _middle(values: Array) -> tuple[float, float]:
    low, high = np.percentile(values, MIDDLE)
    return float(low), float(high)


def _severity(value: float, least: float, good: float) -> Severity | None:
    return "warning" if value < least else "note" if value < good else None


def _pushes(coverage: Coverage) -> Finding | None:
    severity = _severity(coverage.pushes, FEWEST_PUSHES, GOOD_PUSHES)
    if severity is None:
        return None
    sentence = f"{_contained(coverage)}: a learnt model needs {GOOD_PUSHES} or more."
    advice = f"Record at least {GOOD_PUSHES - coverage.pushes} more pushes of 20 mm or longer."
    return Finding("few_pushes", severity, sentence, advice, {"pushes": Value(coverage.pushes, "1")})


def _missing_sides(coverage: Coverage) -> Finding | None:
    """A warning only if no side of the same kind was pushed: a model folds the outline's rotational symmetry."""
    counts = coverage.side_counts
    if counts is None or not coverage.alike or np.all(counts):
        return None
    kinds = counts.reshape(-1, coverage.alike).sum(axis=0)
    missing = np.flatnonzero(counts == 0) + 1
    pushed = np.flatnonzero(counts) + 1
    severity: Severity = "note" if np.all(kinds) else "warning"
    sentence = f"Pushed: {_listed(coverage.side, pushed)} of {len(counts)}, counter-clockwise from the first vertex."
    advice = f"Push {_listed(coverage.side, missing)} too"
    why = "." if severity == "warning" else ": the outline is checked better, and differences of sides are found."
    return Finding("few_sides", severity, sentence, advice + why, {"pushed": Value(len(pushed), "1")})


def _listed(side: str, numbers: IntArray) -> str:
    return f"{side}{'' if len(numbers) == 1 else 's'} {', '.join(map(str, numbers))}"


def _speeds(coverage: Coverage) -> Finding | None:
    low, high = coverage.speeds
    if high > ONE_SPEED * low:
        return None
    sentence = f"Nearly all pushes have one speed, {1e3 * low:.3g} to {1e3 * high:.3g} mm/s."
    advice = "Record further speeds, 10 to 100 mm/s for example, if you want to predict them."
    return Finding("one_speed", "note", sentence, advice, {"low": Value(low, "m/s"), "high": Value(high, "m/s")})


def _angles(coverage: Coverage) -> Finding | None:
    low, high = coverage.angles
    severity = _severity(high - low, NARROWEST_ANGLES, GOOD_ANGLES)
    if severity is None:
        return None
    sentence = f"The push angles span {np.degrees(low):.0f} to {np.degrees(high):.0f} degrees only (middle 90 %)."
    advice = "Record pushes at -60 to 60 degrees to the inward normal."
    return Finding("few_angles", severity, sentence, advice, {"low": Value(low, "rad"), "high": Value(high, "rad")})


def _slides(coverage: Coverage) -> Finding | None:
    share = coverage.sliding
    if share is None or (severity := _severity(share, LEAST_SLIDING, GOOD_SLIDING)) is None:
        return None
    sentence = f"The contact slides along the edge in {100.0 * share:.0f} % of the steps only."
    advice = "Record pushes at angles beyond 40 degrees, and longer ones: there the contact slides."
    return Finding("few_sliding", severity, sentence, advice, {"share": Value(share, "1")})


def _contained(coverage: Coverage) -> str:
    return f"The data contain {coverage.pushes} push{'' if coverage.pushes == 1 else 'es'}"


# --- how the contacts lie on the outline ------------------------------------------------------------------------------


@dataclass(frozen=True)
class ContactFit:
    """The contacts of a recording against the outline of its rig, as given.

    samples: in contact, judged by motion alone. inside, off: shares of them with the tip over OFF inside the outline,
    or away from it. side: "side" or "quarter"; gaps: median gap (m, negative inside) on each, counter-clockwise from
    the first vertex, None without a contact. contact_time, window_time: s in contact, and in windows; the latter None
    where no windows were searched for.
    """

    samples: int
    inside: float
    off: float
    side: str
    gaps: tuple[float | None, ...]
    contact_time: float
    window_time: float | None

    @property
    def lost(self) -> float | None:
        """Share of the time in contact that is in no window, None where no windows were searched for."""
        if self.window_time is None:
            return None
        return max(0.0, 1.0 - self.window_time / self.contact_time)

    def record(self) -> dict[str, object]:
        """The entry in the JSON."""
        return {
            "samples": self.samples,
            "inside_share": self.inside,
            "off_share": self.off,
            "gap_by_side": list(self.gaps),
            "contact_time": self.contact_time,
            "window_time": self.window_time,
            "lost_share": self.lost,
        }


def contact_fit(motion: Motion | None, rig: Rig, table: PushTable | None = None) -> ContactFit | None:
    """The fit of a recording's contacts, None without one. table: of its windows, tiled end to end."""
    if motion is None or not motion.contact.any():
        return None
    touch = motion.contact
    nearest = rig.outline.project(to_body(motion.tip, motion.slider)[touch])
    gap, (index, count, side) = nearest.distance - rig.pusher_radius, sides_of(rig.outline, nearest.contact)
    gaps = [float(np.median(gap[index == k])) if np.any(index == k) else None for k in range(count)]
    return ContactFit(
        samples=int(np.sum(touch)),
        inside=float(np.mean(gap < -OFF)),
        off=float(np.mean(gap > OFF)),
        side=side,
        gaps=tuple(gaps),
        contact_time=_contact_time(motion),
        window_time=None if table is None else float(np.sum(table.duration)),
    )


def _contact_time(motion: Motion) -> float:
    """Time (s) from samples in contact to the next ones, without dropouts."""
    step = np.diff(motion.time)
    period = float(np.median(step))
    step = np.append(np.where(step > longest_interval(period), period, step), period)
    return float(np.sum(step[motion.contact]))
