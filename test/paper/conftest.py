"""The figures of single sections are drawn coarsely: test_paper_report lays all of them out as a reader sees them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="module", autouse=True)
def coarse_pictures() -> Iterator[None]:
    """Draw few pixels and do not fit axes and labels: of a section's time each takes a quarter."""
    with pytest.MonkeyPatch.context() as coarse:
        coarse.setattr("push_predictor.reporting.canvas.DPI", 40)
        coarse.setattr("push_predictor.reporting.canvas.LAYOUTS", 0)
        yield
