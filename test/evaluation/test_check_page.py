# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The page of a check: the answer first, the contacts on the outline, and the correction that findings estimate."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mistakes import heading_in_degrees, tracked
from repository import REPOSITORY

from push_predictor.evaluation.check_page import (
    Correction,
    answer_of,
    check_json,
    contact_chart,
    contact_sentence,
    correction_of,
    track_chart,
    with_minus,
    write_check_page,
)
from push_predictor.recordings.checks.check import CheckedData, checked_data, checked_recording
from push_predictor.recordings.load import load_data
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.table_file import write_table
from push_predictor.reporting import html
from push_predictor.reporting.chart import Dots, Line

HEXAGON = REPOSITORY / "bags" / "hexagon_delrin"
YAW, SHIFT = np.radians(5.0), (0.003, -0.002)


@pytest.fixture(scope="module")
def sound() -> CheckedData:
    return checked_data(HEXAGON)


@pytest.fixture(scope="module")
def turned() -> CheckedData:
    return checked_recording(tracked(read_recording(HEXAGON), YAW, SHIFT))


@pytest.fixture(scope="module")
def refused() -> CheckedData:
    return checked_recording(heading_in_degrees(read_recording(HEXAGON)))


def test_sound_data_are_called_sound(sound: CheckedData) -> None:
    sentences, label = answer_of(sound)
    assert label == "sound" and len(sentences) == 3
    assert sentences[0] == "No mistake was found."
    assert "record at least 20 more pushes" in sentences[1]
    assert "10 pushes (53 windows) on 6 of 6 sides" in sentences[2] and "\N{MINUS SIGN}67" in sentences[2]


def test_the_answer_begins_with_the_mistake_and_what_to_do(turned: CheckedData) -> None:
    sentences, label = answer_of(turned)
    assert label == "check first"
    assert sentences[0].startswith("2 mistakes are probable. The slider is turned by \N{MINUS SIGN}5.0 degrees")
    assert sentences[1].startswith("Turn the outline")
    alone = replace(turned, findings=[next(each for each in turned.findings if each.severity == "warning")])
    assert answer_of(alone)[0][0].startswith("A mistake is probable.")


def test_refused_data_cannot_be_used(refused: CheckedData) -> None:
    sentences, label = answer_of(refused)
    assert label == "refused" and sentences[0].startswith("These data cannot be used.")


def test_hyphens_of_words_and_dates_stay() -> None:
    assert with_minus("x-1 at -5 of 2026-11-23, (-2.8)") == "x-1 at \N{MINUS SIGN}5 of 2026-11-23, (\N{MINUS SIGN}2.8)"


def test_the_corrected_outline_goes_through_the_contacts(turned: CheckedData) -> None:
    contacts = contact_chart(turned)
    (dots,) = (mark for mark in contacts.marks if isinstance(mark, Dots))
    recorded, corrected = (mark for mark in contacts.marks if isinstance(mark, Line))

    def misses(outline: Line) -> float:
        """The median distance (mm) of contacts from a polygon."""
        start = np.column_stack([outline.x, outline.y])
        along, points = np.diff(start, axis=0), np.column_stack([dots.x, dots.y])
        offset = points[:, None] - start[:-1]
        share = np.clip(np.sum(offset * along, axis=2) / np.sum(along**2, axis=1), 0.0, 1.0)
        return float(np.median(np.min(np.linalg.norm(offset - share[..., None] * along, axis=2), axis=1)))

    assert misses(corrected) < 0.1 < 1.0 < misses(recorded)


def test_a_correction_there_and_back_changes_nothing() -> None:
    correction, points = Correction(0.3, 0.01, -0.02, 1.1), np.random.default_rng(0).normal(size=(5, 2))
    np.testing.assert_allclose(correction.own(correction.tracked(points)), points)


def test_both_axes_of_the_tracks_have_one_scale(sound: CheckedData) -> None:
    for chart in (contact_chart(sound), track_chart(sound)):
        frame, box = chart.frame, chart.box
        across = (box["right"] - box["left"]) / (frame.x[1] - frame.x[0])
        assert across == pytest.approx((box["bottom"] - box["top"]) / (frame.y[1] - frame.y[0]))
        lines = [mark for mark in chart.marks if isinstance(mark, Line)]
        assert all(frame.inside(line.x, line.y).all() for line in lines)


def test_the_json_has_answer_correction_and_coverage(turned: CheckedData, sound: CheckedData) -> None:
    content = check_json(turned)
    assert content["verdict"] == "check first"
    correction = correction_of(turned.findings)
    assert correction is not None and content["correction"] == correction.record()
    assert correction.yaw == pytest.approx(-YAW, abs=0.01) and correction.scale == 1.0
    assert check_json(sound)["correction"] is None


def test_the_page_contains_answer_findings_and_folded_tables(
    turned: CheckedData, sound: CheckedData, refused: CheckedData, tmp_path: Path
) -> None:
    write_check_page(tmp_path / "check.html", {"monday": turned, "tuesday": sound, "wednesday": refused})
    text = (tmp_path / "check.html").read_text()
    assert text.count('<div class="answer">') == 3
    assert re.findall(r"<h2>(monday|tuesday|wednesday)</h2>", text) == ["monday", "tuesday", "wednesday"]
    assert text.index('class="opening"') < text.index("Contacts on the outline") < text.index("<h2>Findings</h2>")
    assert text.index("<h2>Findings</h2>") < text.index("Tracks from above")
    assert text.count("<summary>Coverage in numbers (") == 2 and "outline_turned, yaw" in text
    assert text.count("<summary>Median gap between tip and outline by side (6 rows)</summary>") == 3
    assert text.count("<table") == text.count('<details class="tabular">')
    for gap in turned.contacts.gaps:
        assert f">{html.number(gap and 1e3 * gap, 2)}<" in text


def test_the_caption_and_the_json_state_where_the_contacts_are(
    turned: CheckedData, sound: CheckedData, refused: CheckedData
) -> None:
    """A slider shifted by 3.6 mm is partly inside its outline and partly off it."""
    for checked, low, high in ((sound, 0.0, 0.01), (turned, 0.4, 1.0)):
        contacts = check_json(checked)["contacts"]
        assert isinstance(contacts, dict) and checked.contacts is not None
        assert low <= contacts["inside_share"] + contacts["off_share"] <= high
        assert contacts["samples"] > 1000 and len(contacts["gap_by_side"]) == 6
        assert contacts["lost_share"] == pytest.approx(1.0 - contacts["window_time"] / contacts["contact_time"])
    assert sound.contacts is not None and refused.contacts is not None and refused.contacts.lost is None
    assert contact_sentence(sound.contacts) == (
        "0.0 % of the contacts are more than 1 mm inside it, 0.0 % as far outside. "
        "Windows use 97 % of the time in contact."
    )
    assert contact_sentence(refused.contacts).endswith("as far outside.")


def test_a_table_has_a_page_without_tracks(tmp_path: Path) -> None:
    write_table(tmp_path / "pushes.csv", load_data([HEXAGON]))
    write_check_page(tmp_path / "check.html", {"pushes.csv": checked_data(tmp_path / "pushes.csv")})
    text = (tmp_path / "check.html").read_text()
    assert "Tracks from above" not in text and "Pushes by speed and angle" in text
