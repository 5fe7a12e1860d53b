# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The validation report: maps of predictions and recordings, answers first, and every number of the metrics."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from coarse import coarse_fits
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import f, kstest, multivariate_t

from push_predictor.errors import PushPredictorError, TableError
from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.metrics import standardised
from push_predictor.evaluation.report.figures.calibration import (
    LEVELS,
    coverage_chart,
    coverage_curve,
    expected_counts,
)
from push_predictor.evaluation.report.figures.ellipses import (
    ellipse,
    examples,
    inside,
    magnification,
    spread_rows,
    start_pose,
)
from push_predictor.evaluation.report.figures.residuals import trend
from push_predictor.evaluation.report.maps import (
    FEWEST,
    arc_length,
    coarse_cells,
    colour_scale,
    commonest_condition,
    fine_cells,
    predicted_at_windows,
    push_map,
    recorded_map,
    sector_length,
)
from push_predictor.evaluation.report.page import write_validation_report
from push_predictor.evaluation.report.summary import calibration_sentence, comparison_sentence
from push_predictor.evaluation.report.tables import paired_difference
from push_predictor.evaluation.validation import Comparison, compare, metrics_json, pit
from push_predictor.geometry.frames import rotate
from push_predictor.geometry.shapes import SHAPES, shape_outline
from push_predictor.models.predictors.tails import STEPS, Tails
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable, concatenate
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.reporting.canvas import draw
from push_predictor.reporting.chart import Band, Line

PICTURES = {"map_mean.png", "map_sd.png", "examples.png", "calibration.png", "residuals.png"}


def rig_of(shape: str) -> Rig:
    return Rig(shape, shape_outline(shape), 0.00475, "plywood", 0.837)


def made_up_table(pushes: int, seed: int, velocity: float = 0.02, name: str = "push") -> PushTable:
    """Pushes of eight windows; dy scatters more where the contact lies off the middle of a square's edge."""
    rng = np.random.default_rng(seed)
    contact = np.repeat(rng.uniform(0.0, 1.0, pushes), 8) + rng.normal(0.0, 0.003, 8 * pushes)
    angle = np.repeat(rng.uniform(-0.9, 0.9, pushes), 8) + rng.normal(0.0, 0.02, 8 * pushes)
    contact = contact % 1.0
    lever, way = contact * 4.0 % 1.0 - 0.5, 0.2 * velocity
    noise = rng.normal(size=(8 * pushes, 3)) * np.column_stack(
        [0.03 + 0 * lever, 0.03 + 0.2 * np.abs(lever), 1.0 + 0 * lever]
    )
    mean = np.column_stack([np.cos(angle), 0.4 * np.sin(angle), 15.0 * lever])
    speed = velocity * (1.0 + 0.01 * rng.normal(size=8 * pushes))
    ids = np.repeat([f"{name}-{k}" for k in range(pushes)], 8)
    inputs = np.column_stack([speed, contact, angle])
    return PushTable(inputs, np.full(8 * pushes, 0.2), way * (mean + noise), ids)


def windows_of(table: PushTable, rig: Rig) -> list[PushWindow]:
    """Windows with these inputs and outcomes, one behind the other, each push heading along x."""
    windows, poses = [], {}
    for row, push in enumerate(table.push_id.tolist()):
        start = poses.get(push, np.zeros(3))
        end = poses[push] = start + table.outcomes[row]
        velocity, contact, angle = table.inputs[row]
        begin = 200_000_000 * row
        when, inputs = (row % 8, begin, begin + 200_000_000), (velocity, contact, angle)
        windows.append(PushWindow(push, *when, *inputs, 0.2, table.outcomes[row], start, end, 0.0, {}))
    return windows


def gaussian_comparison(sd_factor: float, pushes: int = 400, seed: int = 0) -> Comparison:
    """Outcomes drawn from the predicted Gaussians, whose sd is then multiplied by sd_factor."""
    rng = np.random.default_rng(seed)
    root = np.array([[1.0, 0.0, 0.0], [0.5, 0.8, 0.0], [0.2, -0.3, 0.6]]) * 1e-3
    mean = rng.normal(size=(5 * pushes, 3))
    observed = mean + rng.normal(size=(5 * pushes, 3)) @ root.T
    covariance = np.broadcast_to(sd_factor**2 * root @ root.T, (5 * pushes, 3, 3))
    push_id = np.repeat([f"p{k}" for k in range(pushes)], 5)
    return Comparison("made up", 100, push_id, mean, covariance, observed, None, np.zeros(3))


@pytest.fixture(scope="module")
def square() -> Rig:
    return rig_of("rect1")


@pytest.fixture(scope="module")
def table() -> PushTable:
    return concatenate([made_up_table(30, 1), made_up_table(6, 2, velocity=0.05, name="fast")])


@pytest.fixture(scope="module")
def models(square: Rig) -> list[PushModel]:
    training = concatenate([made_up_table(25, 3, name="a"), made_up_table(8, 4, velocity=0.05, name="b")])
    kinds = {"vhgp": 40, "gp": 40, "analytical": None}
    with coarse_fits():
        return [
            train_model(training, square, kind, name=f"my {kind}", options=TrainingOptions(n_train=n, mean="zero"))
            for kind, n in kinds.items()
        ]


@pytest.fixture(scope="module")
def comparisons(models: list[PushModel], table: PushTable) -> list[Comparison]:
    return [compare(model, table) for model in models]


@pytest.fixture(scope="module")
def page(
    tmp_path_factory: pytest.TempPathFactory, square: Rig, table: PushTable, models: list[PushModel],
    comparisons: list[Comparison],
) -> Path:  # fmt: skip
    """The report of the VHGP and the analytical model."""
    out = tmp_path_factory.mktemp("report") / "deep" / "er"
    facts = {"online equals offline": "288 of 288 windows, <1e-9 apart"}
    title, notes = "Held-out <b>square</b> & co", ['a "note" with <script>alert(1)</script>']
    judged = models[::2], comparisons[::2]
    with pytest.MonkeyPatch.context() as coarse:
        coarse.setattr("push_predictor.evaluation.report.maps.FINE", 12)
        coarse.setattr("push_predictor.evaluation.report.figures.gallery.draw", kept)
        return write_validation_report(out, title, table, windows_of(table, square), *judged, facts, notes)


PAINTED: dict[str, Any] = {}  # the figures of the page


def kept(path: Path, size: tuple[float, float], paint: Callable[[Any], None]) -> Path:
    def painted(figure: Any) -> None:
        paint(figure)
        PAINTED[path.name] = figure

    return draw(path, size, painted)


class Shown(HTMLParser):
    """The text of a page, its tags, and the addresses that it refers to."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.text, self.tags, self.addresses, self.alternatives = [], [], [], []
        self.feed(page.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href")]
        self.alternatives += [value for name, value in attrs if name == "alt"]

    def handle_data(self, data: str) -> None:
        self.text.append(data)


# --- maps -----------------------------------------------------------------------------------------------------------


def test_most_common_speed_is_that_of_most_windows(table: PushTable) -> None:
    condition = commonest_condition(table)
    assert condition.velocity == pytest.approx(0.02, rel=0.01)
    assert condition.duration == 0.2
    assert condition.rows.sum() == 240
    np.testing.assert_array_equal(condition.rows, table.inputs[:, 0] < 0.03)


def test_table_without_windows_is_rejected(table: PushTable) -> None:
    with pytest.raises(TableError, match="0 windows"):
        commonest_condition(table.take(np.zeros(len(table), bool)))


def test_predicted_map_equals_the_prediction_at_cell_centres(
    models: list[PushModel], table: PushTable, square: Rig
) -> None:
    cells = fine_cells(square.outline, table)
    for model in models:
        shown = push_map(model, 0.02, 0.2, cells)
        row, column = 20, 7
        contact = cells.contact[column : column + 2].mean() / square.outline.perimeter
        inputs = np.array([[0.02, contact, cells.angle[row : row + 2].mean()]])
        expected = model.predict_rows(inputs, np.array([0.2]))
        assert expected.in_domain[0]
        np.testing.assert_allclose(shown.mean[row, column], expected.mean[0], rtol=1e-9)
        np.testing.assert_allclose(shown.sd[row, column] ** 2, np.diag(expected.covariance[0]), rtol=1e-9)


def test_predicted_map_is_empty_outside_the_domain(models: list[PushModel], table: PushTable, square: Rig) -> None:
    far = PushTable(table.inputs * [1.0, 1.0, 1.5], table.duration, table.outcomes, table.push_id)
    cells = fine_cells(square.outline, far)
    shown = push_map(models[0], 0.02, 0.2, cells)
    steepest = np.abs(models[0].training.inputs[:, 2]).max()
    beyond = np.minimum(np.abs(cells.angle[1:]), np.abs(cells.angle[:-1])) > steepest
    assert beyond.any() and np.isnan(shown.mean[beyond]).all() and np.isnan(shown.sd[beyond]).all()
    assert np.isfinite(shown.mean[len(beyond) // 2]).any()


@pytest.mark.parametrize("shape", SHAPES)
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), pushes=st.integers(1, 40))
def test_every_window_is_in_one_cell_of_the_recorded_map(shape: str, seed: int, pushes: int) -> None:
    outline, table = shape_outline(shape), made_up_table(pushes, seed)
    shown = recorded_map(outline, table, np.zeros_like(table.outcomes), coarse_cells(outline, table))
    assert shown.windows is not None and shown.windows.sum() == len(table)
    np.testing.assert_array_equal(np.isfinite(shown.mean).all(axis=2), shown.windows >= FEWEST)


def test_recorded_cell_has_mean_and_rms_deviation_from_the_prediction(square: Rig, table: PushTable) -> None:
    cells = coarse_cells(square.outline, table)
    predicted = table.outcomes + [1e-3, -2e-3, 0.03]
    shown = recorded_map(square.outline, table, predicted, cells)
    row, column = np.argwhere(shown.windows >= FEWEST)[0]
    along, angle = arc_length(square.outline, table.inputs[:, 1]), table.inputs[:, 2]
    inside_cell = (along >= cells.contact[column]) & (along < cells.contact[column + 1])
    inside_cell &= (angle >= cells.angle[row]) & (angle < cells.angle[row + 1])
    np.testing.assert_allclose(shown.mean[row, column], table.outcomes[inside_cell].mean(axis=0))
    np.testing.assert_allclose(shown.sd[row, column], [1e-3, 2e-3, 0.03])
    expected = predicted_at_windows(square.outline, table, predicted, 4.0 * predicted**2, cells)
    np.testing.assert_allclose(expected.mean[row, column], predicted[inside_cell].mean(axis=0))
    mean_square = 4.0 * np.mean(predicted[inside_cell] ** 2, axis=0)
    np.testing.assert_allclose(expected.sd[row, column] ** 2, mean_square)
    assert shown.pushes is not None and shown.pushes[row, column] == len(set(table.push_id[inside_cell].tolist()))


def test_colour_scale_is_symmetric_for_signed_values_and_starts_at_zero_otherwise() -> None:
    signed = colour_scale([np.linspace(-1.0, 3.0, 101)])
    assert signed.name == "PuOr" and signed.low == -signed.high
    positive = colour_scale([np.linspace(1.0, 3.0, 101), np.array([np.nan])])
    assert positive.low == 0.0 and positive.high == pytest.approx(2.94) and positive.extend == "max"
    nothing = colour_scale([np.full(4, np.nan)])
    assert nothing.low < nothing.high


def test_outcomes_of_similar_windows_are_shifted_to_the_inputs_of_the_example(
    square: Rig, table: PushTable, comparisons: list[Comparison]
) -> None:
    c = comparisons[0]
    exact = Comparison(c.model, c.n_train, c.push_id, c.mean, c.covariance, c.mean, None, c.training_mean)
    shown = examples(square.outline, table, exact, 4)
    assert len(shown) == 4
    for example in shown:
        assert len(example.nearby)
        np.testing.assert_allclose(example.nearby, np.tile(c.mean[example.row], (len(example.nearby), 1)), atol=1e-12)


# --- the page -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_page_contains_every_number_of_the_metrics(page: Path, comparisons: list[Comparison]) -> None:
    text = " ".join(Shown(page).text).replace("−", "-")
    shown = {float(word) for word in re.findall(r"-?\d+\.?\d*(?:e[-+]?\d+)?", text)}
    for comparison in comparisons[::2]:
        metrics = metrics_json(comparison)
        assert metrics["model"] in text
        coverage, joint = metrics.pop("coverage"), metrics.pop("joint_coverage")
        interval = metrics.pop("interval")
        metrics.pop("textbook")  # for the judgement, which states it where it is better
        for value in _numbers(metrics):
            assert float(f"{value:.4g}") in shown
        for value in [*_numbers(coverage), *_numbers(joint), *_numbers([interval["nmse"], interval["nlpd"]])]:
            assert float(f"{value:.3g}") in shown


@pytest.mark.slow
@pytest.mark.usefixtures("page")
def test_counts_of_pushes_and_bars_lie_within_their_axes() -> None:
    for name in ("map_mean.png", "map_sd.png", "calibration.png"):
        for ax in PAINTED[name].axes:
            (left, right), (low, high) = np.sort(ax.get_xlim()), np.sort(ax.get_ylim())
            shown = [text.get_position() for text in ax.texts if text.get_transform() is ax.transData]
            assert not shown or np.ptp(np.array(shown)[:, 0]) > 0.5 * (right - left), name  # all over the map
            shown += [(bar.get_x(), bar.get_height()) for bar in ax.patches if hasattr(bar, "get_height")]
            assert all(left <= x <= right and low <= y <= high for x, y in shown), name
    assert any(low == pytest.approx(-high) for low, high in (ax.get_ylim() for ax in PAINTED["residuals.png"].axes))


@pytest.mark.slow
def test_page_is_self_contained_and_escapes_all_text(page: Path) -> None:
    shown = Shown(page)
    assert shown.addresses and all(address.startswith("data:image/png;base64,") for address in shown.addresses)
    assert "script" not in shown.tags and "b" not in shown.tags and "link" not in shown.tags
    assert "Held-out <b>square</b> & co" in shown.text
    assert len(shown.alternatives) == len(shown.addresses) and all(shown.alternatives)
    assert "url(" not in page.read_text() and "@import" not in page.read_text()


@pytest.mark.slow
def test_page_opens_with_three_sentences_and_one_figure_and_folds_its_tables(page: Path) -> None:
    text = page.read_text()
    opening = text[text.index('<section class="opening">') : text.index("</section>")]
    assert text.index("<h1>") < text.index('<section class="opening">') < text.index("<h2")
    assert opening.count("<p>") == 3 and opening.count("<svg") - opening.count("<svg viewBox") == 1
    assert "Nothing speaks against the model: 95 % intervals cover" in opening  # no alarm was given
    assert '<span class="verdict">no objection</span>' in opening
    assert text.count("<table") == text.count('<details class="tabular">') == 4 and "<details open" not in text
    assert "<summary>Normalised mean squared error (NMSE) per output: 0 is perfect, 1 is no better than" in text


def test_judgement_of_the_page_is_that_of_its_alarm(
    models: list[PushModel], comparisons: list[Comparison], table: PushTable, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr("push_predictor.evaluation.report.page.SECTIONS", ())  # the text alone
    given = (tmp_path, "alarm", table, None, models[:1], comparisons[:1], {}, [])
    for alarm, label in (({"fired": True}, "no longer fits"), ({"fired": False}, "fits")):
        page = write_validation_report(*given, alarm=alarm).read_text()
        assert f'<span class="verdict">{label}</span>' in page


def test_figures_and_numbers_are_written_next_to_the_page(page: Path, comparisons: list[Comparison]) -> None:
    files = {path.name for path in page.parent.iterdir()}
    assert files == PICTURES | {"report.html", "report.json"}  # and no temporary file
    for name in files & PICTURES:
        assert (page.parent / name).read_bytes().startswith(b"\x89PNG")
    content = json.loads((page.parent / "report.json").read_text())
    assert content["metrics"] == json.loads(json.dumps([metrics_json(c) for c in comparisons[::2]]))


def test_report_without_windows_states_so(models: list[PushModel], table: PushTable, tmp_path: Path) -> None:
    none = table.take(np.zeros(len(table), bool))
    page = write_validation_report(tmp_path, "none", none, [], models, [compare(m, none) for m in models], {}, [])
    assert "No window was found" in page.read_text()
    assert not list(tmp_path.glob("*.png"))


def test_report_warns_about_training_pushes(square: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("push_predictor.evaluation.report.page.SECTIONS", ())  # the text alone
    training = made_up_table(4, 1)
    model = train_model(training, square, "analytical", name="analytical")
    seen = training.take(np.arange(8))
    page = write_validation_report(tmp_path, "seen", seen, None, [model], [compare(model, seen)], {}, [])
    assert "(1 for analytical)" in page.read_text() and "held out" not in page.read_text()


def test_rejects_models_comparisons_and_windows_that_do_not_match(
    models: list[PushModel], comparisons: list[Comparison], table: PushTable, square: Rig, tmp_path: Path
) -> None:
    few = table.take(np.arange(5))
    with pytest.raises(PushPredictorError, match="3 models and 2 comparisons"):
        write_validation_report(tmp_path, "", table, None, models, comparisons[:2], {}, [])
    with pytest.raises(PushPredictorError, match="comparison of my vhgp: 288 rows, give the table's 5"):
        write_validation_report(tmp_path, "", few, None, models, comparisons, {}, [])
    with pytest.raises(PushPredictorError, match="5 windows, give the 288"):
        write_validation_report(tmp_path, "", table, windows_of(few, square), models, comparisons, {}, [])


@pytest.mark.parametrize(
    ("sd_factor", "verdict"),
    [(1.0, "no miscalibration beyond chance"), (0.5, "too narrow for Δx, Δy and Δθ"), (2.0, "too wide for Δx")],
)
def test_calibration_sentence_states_whether_intervals_are_too_narrow_or_too_wide(
    sd_factor: float, verdict: str
) -> None:
    assert verdict in calibration_sentence(gaussian_comparison(sd_factor))


def test_comparison_sentence_states_which_model_is_better(comparisons: list[Comparison]) -> None:
    main = comparisons[0]
    worse = replace(main, model="worse", mean=main.mean + 0.5 * main.observed.std(axis=0))
    assert comparison_sentence(main, worse).startswith("worse is worse than my vhgp: its NLPD is ")
    assert comparison_sentence(worse, main).startswith("my vhgp is better than worse: its NLPD is ")
    assert "cannot be distinguished" in comparison_sentence(main, replace(main, model="same"))


def test_error_names_the_extra_without_matplotlib(
    models: list[PushModel], comparisons: list[Comparison], table: PushTable, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(PushPredictorError, match=r"pip install 'push_predictor\[report\]'"):
        write_validation_report(tmp_path, "", table, None, models, comparisons, {}, [])
    assert not (tmp_path / "report.html").exists()


def test_paired_difference_is_zero_to_itself_and_positive_to_a_worse_model(comparisons: list[Comparison]) -> None:
    main = comparisons[0]
    nmse, nlpd = paired_difference(main, main)
    assert nmse == nlpd == Estimate(0.0, 0.0, 0.0)
    shifted = main.mean + 0.2 * main.observed.std(axis=0)
    worse = Comparison("worse", 1, main.push_id, shifted, main.covariance, main.observed, None, main.training_mean)
    for found in paired_difference(main, worse):
        assert 0.0 < found.low < found.value < found.high
    totals = [metrics_json(c)["nmse"]["total"] for c in (main, worse)]
    assert paired_difference(main, worse)[0].value == pytest.approx(totals[1] - totals[0])


def _numbers(content: object) -> list[float]:
    if isinstance(content, dict):
        return [number for value in content.values() for number in _numbers(value)]
    if isinstance(content, list):
        return [number for value in content for number in _numbers(value)]
    return [float(content)] if isinstance(content, int | float) else []


# --- folding --------------------------------------------------------------------------------------------------------


@given(contact=st.floats(0.0, 0.2499), quarter=st.integers(0, 3))
def test_arc_length_is_equal_on_all_sides_of_a_square(contact: float, quarter: int) -> None:
    outline = shape_outline("rect1")
    along = arc_length(outline, np.array([contact, contact + 0.25 * quarter]))
    assert along[0] == pytest.approx(contact * 0.36, abs=1e-12)
    assert along[1] == pytest.approx(along[0], abs=1e-12)


@pytest.mark.parametrize(("shape", "edges", "length"), [("rect1", 4, 0.09), ("hex", 6, 0.0605)])
def test_end_of_an_edge_has_the_arc_length_of_the_edge(shape: str, edges: int, length: float) -> None:
    outline = shape_outline(shape)
    ends = outline.contact_on_edge(np.arange(edges), np.ones(edges))
    assert arc_length(outline, ends) == pytest.approx(np.full(edges, length))
    starts = outline.contact_on_edge(np.arange(edges), np.zeros(edges))
    assert arc_length(outline, starts) == pytest.approx(np.zeros(edges), abs=1e-12)


def test_ellipse_has_two_equal_parts_and_circle_is_not_folded() -> None:
    ellipse_outline, circle = shape_outline("ellip2"), shape_outline("ellip1")
    contact = np.array([0.1, 0.6])
    assert np.ptp(arc_length(ellipse_outline, contact)) == pytest.approx(0.0, abs=1e-12)
    assert sector_length(ellipse_outline) == pytest.approx(ellipse_outline.perimeter / 2.0)
    assert arc_length(circle, contact) == pytest.approx(contact * circle.perimeter)


# --- ellipses and examples ------------------------------------------------------------------------------------------


def test_ellipse_contains_its_share_of_outcomes() -> None:
    c = gaussian_comparison(1.0)
    hits = [inside(c.mean[k], c.covariance[k], c.observed[[k]], None)[0] for k in range(len(c.mean))]
    assert np.mean(hits) == pytest.approx(0.95, abs=0.02)
    border = ellipse(c.covariance[0, :2, :2], None)
    squared = np.sum(border * np.linalg.solve(c.covariance[0, :2, :2], border.T).T, axis=1)
    np.testing.assert_allclose(squared, -2.0 * np.log(0.05), rtol=1e-9)


def test_ellipse_is_that_of_the_tails() -> None:
    c, tails = gaussian_comparison(1.0), Tails(np.ones(3), np.full(3, 4.0), 0.8, 3.0, 20, np.zeros((STEPS, 3)))
    border = ellipse(c.covariance[0, :2, :2], tails, 0.9)
    squared = np.sum(border * np.linalg.solve(c.covariance[0, :2, :2], border.T).T, axis=1)
    np.testing.assert_allclose(squared, 2.0 * 0.8**2 * f.ppf(0.9, 2, 3.0), rtol=1e-9)
    root = np.linalg.cholesky(c.covariance[0])
    draws = 0.8 * multivariate_t(shape=np.eye(3), df=3.0, seed=0).rvs(20_000) @ root.T
    assert np.mean(inside(np.zeros(3), c.covariance[0], draws, tails, 0.9)) == pytest.approx(0.9, abs=0.01)


@given(seed=st.integers(0, 10_000), count=st.integers(1, 9))
@settings(max_examples=30, deadline=None)
def test_examples_come_from_different_pushes(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    push_id = rng.integers(0, 6, 40).astype(np.str_)
    rows = spread_rows(rng.normal(size=(40, 2)), push_id, count)
    assert len(rows) == min(count, len(set(push_id.tolist())))
    assert len(set(push_id[rows].tolist())) == len(rows)


@pytest.mark.parametrize("shape", SHAPES)
@given(contact=st.floats(0.0, 0.999), angle=st.floats(-1.5, 1.5))
@settings(max_examples=25, deadline=None)
def test_slider_touches_the_origin_and_is_pushed_to_the_right(shape: str, contact: float, angle: float) -> None:
    outline = shape_outline(shape)
    pose = start_pose(outline, np.array([0.02, contact, angle]))
    touch = rotate(outline.point(np.array([contact]))[0], pose[2]) + pose[:2]
    np.testing.assert_allclose(touch, 0.0, atol=1e-12)
    normal = rotate(outline.inward_normal(np.array([contact]))[0], pose[2])
    assert -np.arctan2(normal[1], normal[0]) == pytest.approx(angle, abs=1e-9)


def test_small_motions_are_enlarged_and_large_ones_are_not() -> None:
    outline = shape_outline("rect1")
    assert magnification(outline, np.array([[0.0004, 0.0, 0.0]])) == 20.0
    assert magnification(outline, np.array([[0.05, 0.0, 0.0]])) == 1.0
    assert magnification(outline, np.array([[0.0004, 0.0, 0.0], [0.05, 0.0, 0.0]])) == 1.0  # all in one picture


# --- calibration and drift ------------------------------------------------------------------------------------------


def test_coverage_of_a_calibrated_prediction_is_on_the_diagonal_of_an_overconfident_one_below() -> None:
    share, low, high = coverage_curve(gaussian_comparison(1.0))
    assert np.abs(share - LEVELS[:, None]).max() < 0.04
    assert np.all(low <= share) and np.all(share <= high)
    overconfident = coverage_curve(gaussian_comparison(0.5))[0]
    assert np.all(overconfident[5:-5] < LEVELS[5:-5, None] - 0.03)
    for column in pit(gaussian_comparison(1.0)).T:
        assert kstest(column, "uniform").pvalue > 1e-3
    assert kstest(pit(gaussian_comparison(0.5))[:, 0], "uniform").pvalue < 1e-6


def test_band_of_the_pit_counts_the_windows_of_a_push_together() -> None:
    """Alone, windows scatter as binomial counts do; in pushes of 5 equal windows, root 5 times as much."""
    rng = np.random.default_rng(4)
    alone = expected_counts(rng.random(2000), np.arange(2000).astype(np.str_))
    assert np.mean(alone) == pytest.approx(200.0)
    assert np.diff(alone)[0] == pytest.approx(2.0 * 1.96 * np.sqrt(2000 * 0.1 * 0.9), rel=0.01)
    together = expected_counts(np.repeat(rng.random(400), 5), np.repeat(np.arange(400), 5).astype(np.str_))
    assert np.diff(together)[0] == pytest.approx(np.sqrt(5.0) * np.diff(alone)[0], rel=0.01)
    one_push = expected_counts(np.append(rng.random(39), 1.0), np.zeros(40, dtype=np.str_))
    assert one_push[0] >= 0.0


def test_joint_region_is_that_of_the_tails() -> None:
    c = gaussian_comparison(1.0)
    tails = Tails(np.ones(3), np.full(3, 4.0), 0.8, 3.0, 20, np.zeros((STEPS, 3)))
    away = np.linalg.norm(standardised(c.mean, c.covariance, c.observed), axis=1)
    np.testing.assert_array_equal(replace(c, tails=tails).joint_covered([0.9])[:, 0], away <= tails.joint_radius(0.9))
    assert c.joint_covered([0.9]).mean() == pytest.approx(0.9, abs=0.02)
    assert replace(c, tails=tails).joint_covered([0.9]).mean() > 0.91


def test_trend_detects_a_drift_and_none_without_one() -> None:
    rng = np.random.default_rng(8)
    place, push_id = np.repeat(np.arange(60.0), 5), np.repeat(np.arange(60).astype(np.str_), 5)
    still = np.repeat(rng.normal(size=60), 5) + 0.3 * rng.normal(size=300)
    found = trend(place, still, push_id)
    assert found is not None and found.low < 0.0 < found.high
    drifting = trend(place, still + 3.0 * place / 59.0, push_id)
    assert drifting is not None and drifting.low > 0.0
    assert drifting.value == pytest.approx(found.value + 3.0, abs=1e-9)
    assert trend(place[:5], still[:5], push_id[:5]) is None


def test_coverage_chart_shows_each_output_and_its_band() -> None:
    chart = coverage_chart(gaussian_comparison(0.5, pushes=40))
    bands = [mark for mark in chart.marks if isinstance(mark, Band)]
    lines = [mark for mark in chart.marks if isinstance(mark, Line)]
    assert [line.name for line in lines] == ["as promised", "Δx", "Δy", "Δθ"] and len(bands) == 3
    for band, line in zip(bands, lines[1:], strict=True):
        assert np.all((band.low <= line.y) & (line.y <= band.high)) and line.kind == band.kind
        assert np.all(line.y[5:-5] < line.x[5:-5])  # too narrow: below the diagonal, in percent
        assert line.x[-1] == pytest.approx(98.0) and line.y[-1] > 50.0
