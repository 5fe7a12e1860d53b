# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The search for unexplained effects: false-alarm rate, power, and correct names."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from push_predictor.residuals.selection.forward_selection import ForwardSelection, SearchResult, search
from push_predictor.residuals.selection.term_choice import TermChoice

from push_predictor.geometry.outline import Outline
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect, design_of
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.mechanics.fitted import analytical_mechanics
from push_predictor.models.mechanisms import LIBRARY
from push_predictor.models.predictors import MechanicsPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.enumeration import candidates_of, confounded
from push_predictor.residuals.channels.variance import variance_effects
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of
from push_predictor.residuals.selection.baseline import Baseline, baseline_of
from push_predictor.residuals.selection.power import detectable_json, minimum_detectable
from push_predictor.residuals.selection.screening import Controlled, screen

COUNT, WINDOWS = 100, 2  # pushes of a session, as few as have blocks enough (FEWEST_BLOCKS); windows of a push
SIDE = 0.09
SQUARE = Outline(0.5 * SIDE * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]))
RIG = Rig("square", SQUARE, 0.00475, "made up", 0.8)
MECHANICS = analytical_mechanics(SQUARE, 0.00475, 0.25)
NOISE = np.array([0.00007, 0.0001, 0.0028])  # m, m, rad
FOUR = ("contact_friction", "pressure_spread", "centre_of_friction", "anisotropic_friction")
DRIVERS = ("elapsed_time", "topic:/temperature", "slider_x", "slider_heading", "edge")


def pushes(n: int, seed: int, noise: np.ndarray = NOISE) -> PushTable:
    """Pushes of a square with contact friction 0.25; half of the noise is common to the windows of a push."""
    rng = np.random.default_rng(seed)
    push = np.repeat(np.arange(n), WINDOWS)
    edge = rng.integers(4, size=n)[push].astype(np.float64)
    contact = (edge + rng.uniform(0.05, 0.95, n)[push]) / 4.0
    inputs = np.column_stack([np.full(len(push), 0.02), contact, rng.uniform(-1.0, 1.0, n)[push]])
    duration = np.full(len(push), 0.2)
    drawn = np.sqrt(0.5) * (rng.normal(size=(n, 3))[push] + rng.normal(size=(len(push), 3)))
    walk = np.cumsum(rng.normal(size=n))
    covariates = {
        "elapsed_time": 10.0 * push + rng.uniform(0.0, 3.0, n)[push],
        "topic:/temperature": 20.0 + walk[push],
        "slider_x": rng.normal(0.0, 0.03, n)[push],
        "slider_heading": rng.uniform(-np.pi, np.pi, n)[push],
        "edge": edge,
    }
    outcomes = MECHANICS.displacement(inputs, duration) + noise * drawn
    return PushTable(inputs, duration, outcomes, np.array([f"{seed} {k}" for k in push]), covariates)


def seen(model: PushModel, table: PushTable) -> Evidence:
    """The evidence of a table, where effects act on the mechanics that made it."""
    return replace(evidence_of(model, table), mechanics=MECHANICS)


def with_effect(table: PushTable, mechanism: str | None, basis: DriverBasis, *coefficients: float) -> PushTable:
    push = seen(ANALYTICAL, table).push
    design = design_of(mechanism, basis, MECHANICS, push, np.ones(3))
    return replace(table, outcomes=table.outcomes + design @ np.array(coefficients))


def linear(table: PushTable, name: str) -> DriverBasis:
    values = table.covariates[name]
    return DriverBasis("linear", (name,), (float(values.mean()),), (float(values.std()),))


ANALYTICAL = train_model(pushes(60, 1), RIG, "analytical", name="textbook")


@pytest.fixture(scope="module")
def learnt():
    return train_model(pushes(COUNT, 2), RIG, "gp", name="learnt", options=TrainingOptions(mean="zero"))


@pytest.fixture(autouse=True)
def a_library_of_four(monkeypatch) -> None:
    """Computing responses takes most of the time."""
    in_library(monkeypatch, *FOUR)


def in_library(monkeypatch, *names: str) -> None:
    library = [m for m in LIBRARY if m.name in names]
    monkeypatch.setattr("push_predictor.residuals.candidates.enumeration.LIBRARY", library)


@cache
def baseline(model: PushModel) -> Baseline:
    """The model's errors on its own training data: the same in every search."""
    return baseline_of(model, MECHANICS)


def searched(model, table, alpha=0.01, mechanisms=None, drivers=DRIVERS) -> SearchResult:
    evidence, inputs = seen(model, table), inputs_basis(model, table)
    candidates = candidates_of(evidence, drivers, inputs)
    if mechanisms is not None:
        candidates = [c for c in candidates if c.mechanism is None or c.mechanism in mechanisms]
    return search(evidence, candidates, inputs, alpha, baseline=baseline(model))


class TestFalseAlarms:
    """On synthetic null data the family-wise p is at most alpha with probability alpha."""

    REPETITIONS = 200
    ALPHA = 0.05

    @pytest.mark.long
    @pytest.mark.parametrize(
        ("tails", "common"), [(np.inf, 0.0), (3.0, 0.8)], ids=["normal", "heavy tails, windows of a push alike"]
    )
    def test_stay_within_binomial_bounds(self, tails: float, common: float) -> None:
        alarms = sum(self._smallest_p(seed, tails, common) <= self.ALPHA for seed in range(self.REPETITIONS))
        error = np.sqrt(self.REPETITIONS * self.ALPHA * (1.0 - self.ALPHA))
        assert alarms <= self.REPETITIONS * self.ALPHA + 3.0 * error
        assert alarms >= self.REPETITIONS * self.ALPHA - 3.0 * error

    def _smallest_p(self, seed: int, tails: float, common: float) -> float:
        rng = np.random.default_rng(seed)
        n, pushed = 120, np.repeat(np.arange(40), 3)
        angle = rng.uniform(-1.0, 1.0, 40)[pushed]
        basis = np.cos(angle[:, None] * np.arange(8))  # a fifth of the pushes: as rich as it gets
        draw = rng.standard_normal if np.isinf(tails) else lambda size: rng.standard_t(tails, size)
        z = np.sqrt(common) * draw((40, 3))[pushed] + np.sqrt(1.0 - common) * draw((n, 3))
        walk = np.cumsum(rng.normal(size=40))[pushed]
        drivers = [pushed / 40.0, pushed / 40.0 + 0.01 * walk, walk, walk**2, rng.normal(size=40)[pushed]]
        responses = [np.eye(3)[:, :1] * angle[:, None, None], np.eye(3) * (1.0 + angle[:, None, None])]
        columns = [response * driver[:, None, None] for response in responses for driver in drivers]
        seen = Controlled.of(z, basis, pushed)
        return float(screen([seen.unit_scores(c) for c in columns], seed).p_value.min())


class TestNoEffect:
    @pytest.mark.slow
    def test_finds_nothing_with_a_learned_base_of_few_pushes(self, learnt) -> None:
        verdicts = [searched(learnt, pushes(COUNT, 100 + seed)) for seed in range(3)]
        assert [len(found.terms) for found in verdicts] == [0, 0, 0]

    @pytest.mark.slow
    def test_effect_that_training_shows_too_is_not_selected(self) -> None:
        """A slider whose sides differ, learned by a model that folds them, has not changed since training."""
        shift = DriverBasis("constant"), 0.003, -0.002
        base = train_model(
            with_effect(pushes(COUNT, 2), "centre_of_friction", *shift),
            RIG,
            "gp",
            name="folds",
            options=TrainingOptions(mean="zero"),
        )
        same = searched(base, with_effect(pushes(COUNT, 3), "centre_of_friction", *shift))
        assert not same.terms
        assert any(same.candidates[k].label == ("centre_of_friction", "edge") for k in same.first.unchanged)
        other = searched(
            base, with_effect(pushes(COUNT, 3), "centre_of_friction", DriverBasis("constant"), -0.003, 0.002)
        )
        assert other.terms[0].best.label == ("centre_of_friction", "edge")

    def test_covariate_confounded_with_the_inputs_is_not_tried(self, learnt) -> None:
        """In pushes ordered by angle, time would be blamed for errors of the base in the angle."""
        table = pushes(COUNT, 3)
        ordered = replace(table, covariates={**table.covariates, "elapsed_time": 100.0 * table.inputs[:, 2]})
        evidence, inputs = seen(learnt, ordered), inputs_basis(learnt, ordered)
        assert confounded(evidence, DRIVERS, inputs) == ["elapsed_time"]
        assert "elapsed_time" not in {c.covariate for c in candidates_of(evidence, DRIVERS, inputs)}

    def test_late_touch_detection_is_not_an_effect_of_time_since_contact(self, learnt) -> None:
        """Only the window that begins with the touch is shorter, by the distance that the pusher travels."""
        table = pushes(COUNT, 3)
        since = np.tile([0.0, 0.2], COUNT)
        late = np.where(since == 0.0, 0.97, 1.0)
        short = MECHANICS.displacement(table.inputs, table.duration * late)
        moved = table.outcomes + short - MECHANICS.displacement(table.inputs, table.duration)
        table = replace(table, outcomes=moved, covariates={**table.covariates, "time_since_contact": since})
        found = searched(ANALYTICAL, table, drivers=("time_since_contact",)).terms
        assert "time_since_contact" not in {term.best.covariate for term in found}

    def test_cross_validated_residuals_of_a_learned_base_are_calibrated(self, learnt) -> None:
        deviation = baseline(learnt).deviation
        assert np.all((deviation > 0.85) & (deviation < 1.15))

    @pytest.mark.slow
    def test_effects_above_the_detectable_size_are_found_and_far_smaller_ones_are_not(self, learnt) -> None:
        table = pushes(COUNT, 103)
        evidence, inputs = seen(learnt, table), inputs_basis(learnt, table)
        found = search(evidence, candidates_of(evidence, DRIVERS, inputs), inputs, 0.01, baseline=baseline(learnt))
        size = detectable_json(minimum_detectable(found, evidence, inputs, 0.01, baseline(learnt)))["contact_friction"][
            "driven"
        ]
        assert size["unit"] == "1"
        small, large = (
            with_effect(table, "contact_friction", linear(table, size["covariate"]), share * size["value"])
            for share in (0.2, 1.5)
        )
        assert not searched(learnt, small).terms
        assert searched(learnt, large).terms


class TestNames:
    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("mechanism", "driver", "coefficients"),
        [
            ("contact_friction", "topic:/temperature", [0.08]),
            ("pressure_spread", "elapsed_time", [0.15]),
            ("centre_of_friction", "slider_x", [0.003, 0.002]),
        ],
    )
    def test_planted_effect_gets_its_mechanism_and_covariate(self, learnt, mechanism, driver, coefficients) -> None:
        plain = pushes(COUNT, 200)
        found = searched(learnt, with_effect(plain, mechanism, linear(plain, driver), *coefficients))
        first = found.terms[0]
        assert first.best.label == (mechanism, driver)
        assert first.naming.known
        assert driver in first.naming.drivers
        assert first.p_value <= 0.01

    def test_anisotropy_of_the_table_depends_on_the_push_heading(self, learnt) -> None:
        table = with_effect(pushes(COUNT, 201), "anisotropic_friction", DriverBasis("constant"), 0.2, 0.1)
        first = searched(learnt, table).terms[0]
        assert first.best.label == ("anisotropic_friction", "push_heading")

    def test_shifted_centre_of_friction_depends_on_the_folded_sides(self, learnt) -> None:
        table = with_effect(pushes(COUNT, 202), "centre_of_friction", DriverBasis("constant"), 0.003, 0.002)
        assert searched(learnt, table).terms[0].best.label == ("centre_of_friction", "edge")

    def test_constant_change_lies_in_the_inputs_of_the_model(self, learnt) -> None:
        table = with_effect(pushes(COUNT, 203), "contact_friction", DriverBasis("constant"), 0.12)
        assert searched(learnt, table).terms[0].best.label == ("contact_friction", "model_inputs")

    def test_analytical_model_finds_a_different_contact_friction(self) -> None:
        found = searched(ANALYTICAL, pushes(COUNT, 204), drivers=())
        assert found.terms[0].best.label == ("contact_friction", "model_inputs")
        assert found.terms[0].coefficients[0] == pytest.approx(0.25 - 0.3, abs=0.02)

    @pytest.mark.slow
    def test_effect_outside_the_library_gets_its_covariate_and_no_mechanism(self, learnt) -> None:
        """Asymmetric slip grows with temperature, but the library contains only two other mechanisms."""
        plain = pushes(COUNT, 205)
        table = with_effect(plain, "contact_asymmetry", linear(plain, "topic:/temperature"), 0.2)
        first = searched(learnt, table, mechanisms=["pressure_spread", "centre_of_friction"]).terms[0]
        assert first.best.label == (None, "topic:/temperature")
        assert not first.naming.known

    @pytest.mark.slow
    def test_effect_like_a_mechanism_is_modelled_as_this_but_not_named_after_it(self, learnt) -> None:
        """Contact friction grows with temperature, and so does a drift to one side that it cannot explain."""
        plain = pushes(COUNT, 207)
        warm = linear(plain, "topic:/temperature")
        table = with_effect(plain, "contact_friction", warm, 0.2)
        drift = np.outer(1.8 * warm.values(plain.covariates, len(plain)), [0.0, NOISE[1], 0.0])
        first = searched(learnt, replace(table, outcomes=table.outcomes + drift)).terms[0]
        assert first.best.label == ("contact_friction", "topic:/temperature")
        assert (first.mechanism, first.naming.resembles) == (None, "contact_friction")

    @pytest.mark.slow
    def test_correlated_covariates_stay_undecided(self, learnt) -> None:
        plain = pushes(COUNT, 206)
        twins = {**plain.covariates, "slid_distance": 0.003 * plain.covariates["elapsed_time"] + 0.001}
        table = with_effect(replace(plain, covariates=twins), "contact_friction", linear(plain, "elapsed_time"), 0.08)
        naming = searched(learnt, table, drivers=(*DRIVERS, "slid_distance")).terms[0].naming
        assert naming.undecided
        assert set(naming.drivers) == {"elapsed_time", "slid_distance"}
        assert naming.mechanisms[0] == "contact_friction"


class TestBasis:
    @pytest.mark.slow
    def test_step_is_found_with_its_place(self, learnt) -> None:
        plain = pushes(COUNT, 300)
        place = 600.0
        table = with_effect(plain, "contact_friction", DriverBasis("step", ("elapsed_time",), place=place), 0.25)
        basis = searched(learnt, table).terms[0].best.basis
        assert basis.name == "step"
        assert basis.place == pytest.approx(place, abs=75.0)

    @pytest.mark.long
    def test_large_effect_that_sets_in_early_is_one_step_of_every_covariate_that_has_it(self) -> None:
        """On mechanics, which absorb no constant effect, most of it looks constant: its onset must be looked for."""
        plain = pushes(200, 302)
        late = DriverBasis("step", ("elapsed_time",), place=305.0)
        after = late.values(plain.covariates, len(plain))[:, 0]
        plain = replace(plain, covariates={**plain.covariates, "topic:/valve": 20.0 + 5.0 * after})
        effect = Effect("contact_friction", "elapsed_time", late, np.array([0.35]), np.zeros((1, 1)), np.ones(3))
        push = Push(plain.inputs, plain.duration, plain.covariates)
        table = replace(plain, outcomes=plain.outcomes + joint_shift(MECHANICS, [effect], push))
        base = replace(ANALYTICAL, predictor=MechanicsPredictor(MECHANICS, ANALYTICAL.predictor.covariance))
        (term,) = searched(base, table, drivers=[*DRIVERS, "topic:/valve"]).terms
        assert (term.best.mechanism, term.best.basis.name) == ("contact_friction", "step")
        assert set(term.naming.drivers) == {"elapsed_time", "topic:/valve"}
        assert not term.own and term.share > 0.5
        evidence, inputs = seen(base, table), inputs_basis(base, table)
        choice = TermChoice(evidence, tuple(candidates_of(evidence, [*DRIVERS, "topic:/valve"], inputs)), inputs, 0)
        screened = ForwardSelection(choice, 0.01, baseline(base)).screened(evidence.z)
        found = np.flatnonzero(screened.p_value <= 0.01).tolist()
        for used in ("elapsed_time", "topic:/valve"):
            again = choice.term(found, screened, evidence.z, {used})
            assert (again.naming.drivers[0], again.best.covariate, again.best.basis.name) == (used, used, "step")

    @pytest.mark.slow
    @pytest.mark.parametrize(("grows", "rivals"), [(True, {"elapsed_time"}), (False, set())])
    def test_constant_effect_may_also_have_grown_early_in_the_session(self, grows: bool, rivals: set[str]) -> None:
        """An effect that soon has its full size looks constant; one that is there from the first push is constant."""
        plain = pushes(COUNT, 302)
        time, always = plain.covariates["elapsed_time"], DriverBasis("constant")
        effect = Effect("contact_friction", "elapsed_time", always, np.array([0.15]), np.zeros((1, 1)), np.ones(3))
        push = Push(plain.inputs, plain.duration, plain.covariates)
        shift = joint_shift(MECHANICS, [effect], push)
        reached = 1.0 - np.exp(-(time - time.min()) / (0.07 * np.ptp(time))) if grows else np.ones(len(time))
        table = replace(plain, outcomes=plain.outcomes + reached[:, None] * shift)
        base = replace(ANALYTICAL, predictor=MechanicsPredictor(MECHANICS, ANALYTICAL.predictor.covariance))
        (term,) = searched(base, table).terms
        assert term.best.label == ("contact_friction", "model_inputs")
        assert set(term.naming.drivers) == {"model_inputs", *rivals}

    @pytest.mark.slow
    def test_onset_of_an_effect_that_is_fixed_to_the_world_is_found(self, monkeypatch) -> None:
        """A slope that is there from the 13th of 100 pushes on looks constant, too."""
        plain = pushes(COUNT, 302)
        late, size = DriverBasis("step", ("elapsed_time",), place=125.0), np.array([0.2, -0.1])
        effect = Effect("tilted_surface", "elapsed_time", late, size, np.zeros((2, 2)), np.ones(3))
        push = Push(plain.inputs, plain.duration, plain.covariates)
        table = replace(plain, outcomes=plain.outcomes + joint_shift(MECHANICS, [effect], push))
        base = replace(ANALYTICAL, predictor=MechanicsPredictor(MECHANICS, ANALYTICAL.predictor.covariance))
        in_library(monkeypatch, "contact_friction", "tilted_surface")
        (term,) = searched(base, table).terms
        assert (term.best.label, term.best.basis.name) == (("tilted_surface", "elapsed_time"), "step")

    @pytest.mark.slow
    def test_constant_effect_that_the_inputs_express_in_part_has_no_onset(self) -> None:
        """An onset before almost all pushes is the constant effect, and must gain more than the whole of this."""
        plain = pushes(COUNT, 303)
        shift, always = np.array([0.015, 0.0]), DriverBasis("constant")
        effect = Effect("centre_of_friction", "edge", always, shift, np.zeros((2, 2)), np.ones(3))
        push = Push(plain.inputs, plain.duration, plain.covariates)
        table = replace(plain, outcomes=plain.outcomes + joint_shift(MECHANICS, [effect], push))
        base = replace(ANALYTICAL, predictor=MechanicsPredictor(MECHANICS, ANALYTICAL.predictor.covariance))
        evidence, inputs = seen(base, table), inputs_basis(base, table)
        sides = table.covariates["edge"][:, None] == np.arange(3)  # they explain a part of the effect
        folded = replace(inputs, folds=True, columns=np.column_stack([inputs.columns, sides]))
        candidates = candidates_of(evidence, DRIVERS, folded)
        first = search(evidence, candidates, folded, 0.01, baseline=baseline(base)).terms[0].best
        assert (first.mechanism, first.basis.is_constant) == ("centre_of_friction", True)

    @pytest.mark.slow
    def test_linear_dependence_stays_linear(self, learnt) -> None:
        plain = pushes(COUNT, 301)
        table = with_effect(plain, "contact_friction", linear(plain, "slider_x"), 0.08)
        assert searched(learnt, table).terms[0].best.basis.name == "linear"


def test_what_a_polynomial_leaves_of_an_unknown_effect_is_no_effect_of_its_own() -> None:
    table = pushes(COUNT, 310)
    lopsided = 1.5 * NOISE[0] * (1.0 + np.cos(table.covariates["slider_heading"]))
    pulled = replace(table, outcomes=table.outcomes + np.outer(lopsided, [1.0, 0.0, 0.0]))
    found = searched(ANALYTICAL, pulled, mechanisms=())
    assert [term.best.label for term in found.terms] == [(None, "slider_heading")]
    left = found.candidates[int(np.argmin(found.last.p_value))]
    assert found.last.p_value.min() <= 0.01
    assert left.label == (None, "model_inputs")


def louder_to_the_right(n: int, seed: int) -> PushTable:
    """Pushes whose noise grows with the place along x."""
    table = pushes(n, seed)
    clean = MECHANICS.displacement(table.inputs, table.duration)
    factor = np.exp(0.5 * table.covariates["slider_x"] / 0.03)
    return replace(table, outcomes=clean + factor[:, None] * (table.outcomes - clean))


class TestVariance:
    @pytest.mark.slow
    def test_variance_that_grows_with_a_covariate_is_not_a_mean_effect(self, learnt) -> None:
        louder = louder_to_the_right(COUNT, 400)
        found = searched(learnt, louder)
        evidence = seen(learnt, louder)
        noise = variance_effects(learnt, evidence, found.unexplained, 0.01, baseline=baseline(learnt))
        assert not found.terms
        assert noise.found[0].covariate == "slider_x"
        assert noise.found[0].ratio > 2.0

    @pytest.mark.slow
    def test_variance_that_grew_with_the_covariate_in_training_too_is_not_reported(self) -> None:
        model = train_model(
            louder_to_the_right(COUNT, 403), RIG, "gp", name="uneven", options=TrainingOptions(mean="zero")
        )
        evidence = seen(model, louder_to_the_right(COUNT, 404))
        assert not variance_effects(model, evidence, evidence.z, 0.01, baseline=baseline(model)).found
        alone = variance_effects(model, evidence, evidence.z, 0.01).found
        assert [effect.covariate for effect in alone] == ["slider_x"]

    def test_variance_as_in_training_is_not_reported(self, learnt) -> None:
        table = pushes(COUNT, 401)
        evidence = seen(learnt, table)
        assert not variance_effects(learnt, evidence, evidence.z, 0.01, baseline=baseline(learnt)).found

    def test_larger_variance_than_in_training_is_reported_as_constant(self, learnt) -> None:
        table = pushes(COUNT, 402, noise=2.0 * NOISE)
        evidence = seen(learnt, table)
        noise = variance_effects(learnt, evidence, evidence.z, 0.01, baseline=baseline(learnt)).found
        assert noise[0].covariate == "model_inputs"
        assert noise[0].ratio == pytest.approx(2.0, rel=0.25)
