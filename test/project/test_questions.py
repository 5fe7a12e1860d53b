# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Twenty questions of readers: the page and the section that answer each exist, two links from the start at most."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from repository import REPOSITORY

STARTS = (REPOSITORY / "README.md", REPOSITORY / "docs" / "index.md")
PLANNER = {
    "How do I ask for one push from a shell?": "README.md#call-it-from-a-planner",
    "What are velocity, contact and angle, and in which frame is the outcome?": "docs/reference/push.md#inputs",
    "How do I ask for many pushes at once?": "docs/reference/predict_server.md#predict_push_batch-predictpushbatch",
    "How uncertain is a sequence of pushes?": "docs/explanation/rollouts.md#what-persists-within-a-push",
    "What is the slider's pose afterwards?": "docs/reference/predict_server.md#predict_slider_pose-predictsliderpose",
    "Why was my request refused?": "docs/reference/predict_server.md#refusals",
    "What can my client do about an error code?": "docs/reference/messages.md#error-codes",
    "How do I plan around obstacles?": "docs/how_to/planner.md#plan-around-obstacles",
    "How long does an answer take?": "docs/results/latency_and_robustness.md#single-calls",
    "Do the intervals cover new pushes?": "docs/results/accuracy.md#intervals-and-correlations",
}
LABORATORY = {
    "What do I measure of my rig?": "docs/how_to/your_own_data.md#measure-the-rig",
    "How do I record my topics, and what does the line say?": "docs/how_to/your_own_data.md#record",
    "Which message types and tf frames can be read?": "docs/reference/recordings.md#topics-and-types",
    "My force sensor turns with the tip. What now?": "docs/reference/recordings.md#axes-of-the-wrench",
    "What does a finding of check mean?": "docs/reference/check.md#streams",
    "Does the model fit my pushes?": "docs/reference/command_line.md#validate",
    "How do I validate while the robot works?": "docs/how_to/live_devices.md#start-the-nodes",
    "What remains when the recorder is killed?": "docs/how_to/your_own_data.md#what-remains-after-a-crash",
    "What does the verdict of a trace mean?": "docs/reference/trace.md#verdicts",
    "What could not be tested?": "docs/explanation/unproven.md#how-to-find-out",
}


def slug(heading: str) -> str:
    """The anchor that the site gives a heading."""
    return re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", heading).strip().lower())


def without_code(page: Path) -> str:
    return re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> set[str]:
    return {slug(heading) for heading in re.findall(r"^#+ (.+)$", without_code(page), re.MULTILINE)}


def linked(page: Path) -> set[Path]:
    targets = re.findall(r"\]\(([^)#\s]+\.md)", without_code(page))
    return {(page.parent / target).resolve() for target in targets if "://" not in target}


def reached() -> set[Path]:
    """The pages that are two links from the start at most."""
    first = {page for start in STARTS for page in linked(start)}
    return {*STARTS, *first, *(page for one in first for page in linked(one))}


def test_the_page_that_answers_a_question_exists_and_is_two_links_away() -> None:
    near = reached()
    for place in (*PLANNER.values(), *LABORATORY.values()):
        name, anchor = place.split("#")
        assert anchor in anchors(REPOSITORY / name) and REPOSITORY / name in near, place


@pytest.mark.parametrize("page", sorted((REPOSITORY / "docs").rglob("*.md")), ids=lambda page: page.name)
def test_every_link_to_a_section_of_a_page_finds_it(page: Path) -> None:
    for target, anchor in re.findall(r"\]\(([^)#\s:]*)#([^)\s]+)\)", without_code(page)):
        assert anchor in anchors((page.parent / target).resolve() if target else page), f"{target}#{anchor}"
