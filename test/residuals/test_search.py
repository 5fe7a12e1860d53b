# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Planted effects get their mechanism, covariate, form and onset; chance and what training has too pass no gate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from search_bench import gate_of, in_library, search_with
from square_session import (
    ANALYTICAL,
    COUNT,
    DRIVERS,
    EXACT,
    FOUR,
    MECHANICS,
    NOISE,
    RIG,
    WINDOWS,
    baseline,
    learnt,
    linear,
    pushes,
    searched,
    seen,
    with_effect,
)

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import candidates_of, confounded
from push_predictor.residuals.channels.contrast import ChannelEffect
from push_predictor.residuals.channels.variance import variance_effects
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.selection.gate import Gate, Seen
from push_predictor.residuals.selection.power import minimum_detectable
from push_predictor.residuals.selection.screening import Columns, screen
from push_predictor.types import Array

TRIED = FOUR


@pytest.mark.parametrize(
    ("mechanism", "covariate", "size"),
    [("anisotropic_friction", "push_heading", (0.2, 0.1)), ("centre_of_friction", "edge", (0.003, 0.002))],
)
def test_constant_effect_of_the_table_or_the_slider_depends_on_the_heading_or_the_side(
    mechanism: str, covariate: str, size: tuple[float, float]
) -> None:
    table = with_effect(pushes(COUNT, 201), mechanism, DriverBasis("constant"), *size)
    assert searched(learnt(), table).terms[0].best.label == (mechanism, covariate)


def test_analytical_model_finds_a_different_contact_friction() -> None:
    found = searched(ANALYTICAL, pushes(COUNT, 204), drivers=())
    assert found.terms[0].best.label == ("contact_friction", "model_inputs")
    assert found.fit.coefficients[0] == pytest.approx(0.25 - 0.3, abs=0.02)


@pytest.mark.slow
def test_effect_outside_the_library_gets_its_covariate_and_no_mechanism() -> None:
    """Asymmetric slip grows with temperature, but the library contains only two other mechanisms."""
    plain = pushes(COUNT, 205)
    table = with_effect(plain, "contact_asymmetry", linear(plain, "topic:/temperature"), 0.2)
    first = searched(learnt(), table, mechanisms=["pressure_spread", "centre_of_friction"]).terms[0]
    assert first.best.label == (None, "topic:/temperature")
    assert not first.naming.known


@pytest.mark.slow
def test_effect_like_a_mechanism_is_modelled_as_this_but_not_named_after_it() -> None:
    """Contact friction grows with temperature, and so does a drift to one side that it cannot explain."""
    plain = pushes(COUNT, 207)
    warm = linear(plain, "topic:/temperature")
    table = with_effect(plain, "contact_friction", warm, 0.2)
    drift = np.outer(4.0 * warm.values(plain.covariates, len(plain)), [0.0, NOISE[1], 0.0])
    first = searched(learnt(), replace(table, outcomes=table.outcomes + drift)).terms[0]
    assert first.best.covariate == "topic:/temperature"
    assert (first.mechanism, first.naming.resembles) == (None, "contact_friction")


@pytest.mark.parametrize("passes", [False, True])
def test_effect_that_passes_as_the_slider_moves_is_not_named_after_a_mechanism(passes: bool) -> None:
    """The contact is more slippery, in all windows of a push or in the first only."""
    plain = pushes(COUNT, 208)
    since = np.resize(0.2 * np.arange(WINDOWS), len(plain))
    timed = replace(plain, covariates={**plain.covariates, "time_since_contact": since})
    table = with_effect(timed, "contact_friction", DriverBasis("constant"), -0.15)
    if passes:
        table = replace(table, outcomes=np.where(since[:, None] > 0.0, plain.outcomes, table.outcomes))
    first = searched(ANALYTICAL, table, drivers=()).terms[0]
    assert first.best.mechanism == "contact_friction"
    assert (first.mechanism is None) == passes
    assert first.naming.resembles == ("contact_friction" if passes else None)


@pytest.mark.slow
def test_correlated_covariates_stay_undecided() -> None:
    plain = pushes(COUNT, 206)
    twins = {**plain.covariates, "slid_distance": 0.003 * plain.covariates["elapsed_time"] + 0.001}
    table = with_effect(replace(plain, covariates=twins), "contact_friction", linear(plain, "elapsed_time"), 0.08)
    naming = searched(learnt(), table, drivers=(*DRIVERS, "slid_distance")).terms[0].naming
    assert set(naming.covariates) == {"elapsed_time", "slid_distance"}
    assert naming.mechanisms[0] == "contact_friction"


def test_what_a_polynomial_leaves_of_an_unknown_effect_is_no_effect_of_its_own() -> None:
    table = pushes(COUNT, 310)
    lopsided = 1.5 * NOISE[0] * (1.0 + np.cos(table.covariates["slider_heading"]))
    pulled = replace(table, outcomes=table.outcomes + np.outer(lopsided, [1.0, 0.0, 0.0]))
    found = searched(ANALYTICAL, pulled, mechanisms=())
    assert [term.best.label for term in found.terms] == [(None, "slider_heading")]


# --- forms ------------------------------------------------------------------------------------------------------------


ALWAYS = DriverBasis("constant")


def sets_in(place: float) -> DriverBasis:
    return DriverBasis("step", ("elapsed_time",), place=place)


def test_step_is_found_with_its_place() -> None:
    table = with_effect(pushes(COUNT, 300), "contact_friction", sets_in(600.0), 0.25)
    basis = searched(learnt(), table).terms[0].best.basis
    assert basis.name == "step"
    assert basis.place == pytest.approx(600.0, abs=75.0) and basis.place not in table.covariates["elapsed_time"]


def test_large_effect_that_sets_in_early_is_one_step_of_every_covariate_that_has_it() -> None:
    """On mechanics, which absorb no constant effect, most of it looks constant."""
    plain, late = pushes(200, 302), sets_in(305.0)
    after = late.values(plain.covariates, len(plain))[:, 0]
    plain = replace(plain, covariates={**plain.covariates, "topic:/valve": 20.0 + 5.0 * after})
    table = with_effect(plain, "contact_friction", late, 0.35)
    (term,) = searched(EXACT, table, drivers=[*DRIVERS, "topic:/valve"]).terms
    assert (term.mechanism, term.best.basis.name) == ("contact_friction", "step")
    assert set(term.naming.covariates) == {"elapsed_time", "topic:/valve"}


def test_an_effect_that_is_there_from_the_first_push_is_constant() -> None:
    table = with_effect(pushes(COUNT, 302), "contact_friction", ALWAYS, 0.15)
    (term,) = searched(EXACT, table).terms
    assert term.best.label == ("contact_friction", "model_inputs")
    assert term.naming.covariates == ("model_inputs",)


def test_an_effect_that_soon_has_its_full_size_may_be_constant_or_have_grown() -> None:
    plain = pushes(COUNT, 302)
    time, whole = plain.covariates["elapsed_time"], with_effect(plain, "contact_friction", ALWAYS, 0.15)
    reached = 1.0 - np.exp(-(time - time.min()) / (0.07 * np.ptp(time)))
    outcomes = plain.outcomes + reached[:, None] * (whole.outcomes - plain.outcomes)
    (term,) = searched(EXACT, replace(plain, outcomes=outcomes)).terms
    assert term.mechanism == "contact_friction"
    assert "elapsed_time" in term.naming.covariates
    assert set(term.naming.covariates) <= {"model_inputs", "elapsed_time"}


def test_onset_of_an_effect_that_is_fixed_to_the_world_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slope that is there from the 13th of 100 pushes on looks constant, too."""
    table = with_effect(pushes(COUNT, 302), "tilted_surface", sets_in(125.0), 0.2, -0.1)
    in_library(monkeypatch, "contact_friction", "tilted_surface")
    (term,) = searched(EXACT, table).terms
    assert (term.best.label, term.best.basis.name) == (("tilted_surface", "elapsed_time"), "step")
    assert term.best.basis.place == pytest.approx(125.0, abs=25.0)


def test_constant_effect_that_the_inputs_express_in_part_has_no_onset() -> None:
    """An onset before almost all pushes is the constant effect."""
    table = with_effect(pushes(COUNT, 303), "centre_of_friction", ALWAYS, 0.015, 0.0)
    evidence = seen(EXACT, table)
    gate = gate_of(EXACT, evidence, DRIVERS, baseline=baseline(EXACT))
    sides = table.covariates["edge"][:, None] == np.arange(3)  # they explain a part of the effect
    folded = replace(gate.inputs, folds=True, columns=np.column_stack([gate.inputs.columns, sides]))
    gate = replace(gate, candidates=tuple(candidates_of(evidence, DRIVERS, folded)), inputs=folded)
    first = search_with(EXACT, gate).terms[0]
    assert (first.mechanism, first.best.basis.is_constant) == ("centre_of_friction", True)


@pytest.mark.parametrize(
    ("mechanism", "driver", "size"),
    [
        ("contact_friction", "slider_x", (0.08,)),
        ("contact_friction", "topic:/temperature", (0.08,)),
        ("centre_of_friction", "slider_x", (0.003, 0.002)),
    ],
)
def test_linear_effect_has_its_mechanism_and_covariate_and_stays_linear(
    mechanism: str, driver: str, size: tuple[float, ...]
) -> None:
    plain = pushes(COUNT, 400)
    (term,) = searched(learnt(), with_effect(plain, mechanism, linear(plain, driver), *size)).terms
    assert (term.best.label, term.naming.covariates) == ((mechanism, driver), (driver,))
    assert term.naming.known and term.p_value <= 0.01 and term.best.basis.name == "linear"


def test_an_effect_that_grows_with_time_grows_from_nothing_at_the_start() -> None:
    plain = pushes(COUNT, 304)
    time = plain.covariates["elapsed_time"]
    grows = DriverBasis("linear", ("elapsed_time",), (float(time.min()),), (float(np.ptp(time)),))
    (term,) = searched(EXACT, with_effect(plain, "contact_friction", grows, 0.3)).terms
    assert (term.best.label, term.best.basis.name) == (("contact_friction", "elapsed_time"), "linear")
    assert not term.best.basis.offset


@pytest.mark.parametrize(
    ("name", "coefficients"), [("periodic", (0.12, 0.06)), ("periodic, twice around", (0.12, 0.06))]
)
def test_an_effect_of_the_heading_is_found_with_its_period(name: str, coefficients: tuple[float, ...]) -> None:
    basis = DriverBasis(name, ("slider_heading",))
    (term,) = searched(EXACT, with_effect(pushes(COUNT, 305), "contact_friction", basis, *coefficients)).terms
    assert (term.best.label, term.best.basis.name) == (("contact_friction", "slider_heading"), name)


# --- gate -------------------------------------------------------------------------------------------------------------


ALPHA = 0.01
OWN_SIDES = DriverBasis("constant"), 0.003, -0.002  # a centre of friction off the middle
Label = tuple[str | None, str]


def gate(model: PushModel, table: PushTable) -> Gate:
    return gate_of(model, seen(model, table), DRIVERS, ALPHA, baseline=baseline(model))


def p_values(gate: Gate) -> dict[Label, float]:
    """The smallest p value of each label."""
    found: dict[Label, float] = {}
    screened = gate.screened(gate.evidence.z)
    for candidate, p in zip(gate.candidates, screened.p_value.tolist(), strict=True):
        found[candidate.label] = min(p, found.get(candidate.label, 1.0))
    return found


@pytest.mark.parametrize("seed", [500, 501])
def test_nothing_passes_without_an_effect(seed: int) -> None:
    for model in (learnt(), EXACT):
        assert min(p_values(gate(model, pushes(COUNT, seed))).values()) > ALPHA


@pytest.fixture(scope="module")
def one_sided() -> PushModel:
    """A model that folds the sides of a slider whose sides differ."""
    table, options = with_effect(pushes(COUNT, 2), "centre_of_friction", *OWN_SIDES), TrainingOptions(mean="zero")
    return train_model(table, RIG, "gp", name="folds", options=options)


def test_a_property_that_the_rig_had_in_training_too_does_not_pass(one_sided: PushModel) -> None:
    again = gate(one_sided, with_effect(pushes(COUNT, 3), "centre_of_friction", *OWN_SIDES))
    screened = again.screened(again.evidence.z)
    assert screened.p_value.min() > ALPHA
    unchanged = {again.candidates[k].label for k in screened.unchanged}
    assert ("centre_of_friction", "edge") in unchanged
    uncompared = replace(again.baseline, inputs=replace(again.baseline.inputs, learnt=False))
    alone = replace(again, baseline=uncompared).screened(again.evidence.z)
    assert alone.p_value.min() <= ALPHA and not alone.unchanged


def test_what_lies_in_the_nuisance_of_a_candidate_changes_no_score() -> None:
    table = pushes(COUNT, 3)
    since = {**table.covariates, "time_since_contact": np.tile([0.0, 0.2], COUNT)}
    evidence = seen(EXACT, replace(table, covariates=since))
    found = gate_of(EXACT, evidence, ["elapsed_time"], baseline=baseline(EXACT), mechanisms=FOUR[:2])
    c = next(c for c in found.candidates if c.kind == "constant" and c.nuisance is not None)
    assert c.nuisance is not None
    moved = evidence.z + 50.0 * c.nuisance[:, 0].reshape(evidence.z.shape)
    apart = [Seen(found.inputs, z, evidence.block) for z in (evidence.z, moved)]
    first, second = (each.scores(c, each.columns(c)).rows for each in apart)
    np.testing.assert_allclose(first, second, atol=1e-8)


def test_the_opposite_of_that_property_passes(one_sided: PushModel) -> None:
    basis, x, y = OWN_SIDES
    other = with_effect(pushes(COUNT, 3), "centre_of_friction", basis, -x, -y)
    assert p_values(gate(one_sided, other))["centre_of_friction", "edge"] <= ALPHA


def test_an_error_in_a_learnt_models_own_inputs_is_judged_against_training() -> None:
    """Few pushes teach a model its inputs only so well; a new session shows the same error."""
    few = train_model(pushes(25, 4), RIG, "gp", name="few", options=TrainingOptions(mean="zero"))
    found = gate(few, pushes(COUNT, 5))
    own = [k for k, c in enumerate(found.candidates) if c.kind == "constant"]
    assert own and found.screened(found.evidence.z).p_value[own].min() > ALPHA


def test_p_values_of_one_seed_are_the_same_again() -> None:
    made = gate(EXACT, pushes(COUNT, 504))
    z = made.evidence.z
    np.testing.assert_array_equal(made.screened(z).p_value, made.screened(z).p_value)
    assert not np.array_equal(made.screened(z).p_value, replace(made, seed=1).screened(z).p_value)


# --- the search -------------------------------------------------------------------------------------------------------


WEAK, REPETITIONS, LEVEL = 0.02, 200, 0.05


@pytest.mark.long
@pytest.mark.parametrize(
    ("tails", "common"), [(np.inf, 0.0), (3.0, 0.8)], ids=["normal", "heavy tails, windows of a push alike"]
)
def test_false_alarms_stay_within_binomial_bounds(tails: float, common: float) -> None:
    """On synthetic null data the family-wise p is at most alpha with probability alpha."""
    alarms = sum(_smallest_p(seed, tails, common) <= LEVEL for seed in range(REPETITIONS))
    error = np.sqrt(REPETITIONS * LEVEL * (1.0 - LEVEL))
    assert alarms <= REPETITIONS * LEVEL + 3.0 * error
    assert alarms >= REPETITIONS * LEVEL - 3.0 * error


def _smallest_p(seed: int, tails: float, common: float) -> float:
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
    residualizer = Residualizer(basis)
    blocks, each = residualizer.blocks(z, pushed), [Columns(residualizer(c)) for c in columns]
    return float(screen([c.scores(blocks).turned(c.unit) for c in each], seed).p_value.min())


def test_the_gate_alone_decides_at_its_level() -> None:
    """A weak effect, at levels above and below its p value."""
    plain = pushes(COUNT, 106)
    weak = with_effect(plain, "contact_friction", linear(plain, "slider_x"), WEAK)
    gate = gate_of(EXACT, seen(EXACT, weak), DRIVERS, baseline=baseline(EXACT))
    p = float(gate.screened(gate.evidence.z).p_value.min())
    assert 0.001 < p < 0.2
    above, below = (search_with(EXACT, replace(gate, alpha=share * p)).terms for share in (1.1, 0.9))
    assert [term.best.label for term in above] == [("contact_friction", "slider_x")]
    assert above[0].p_value == p
    assert not below


def test_covariate_confounded_with_the_inputs_is_not_tried() -> None:
    """In pushes ordered by angle, time would be blamed for errors of the base in the angle."""
    table = pushes(COUNT, 3)
    ordered = replace(table, covariates={**table.covariates, "elapsed_time": 100.0 * table.inputs[:, 2]})
    evidence, inputs = seen(learnt(), ordered), inputs_basis(learnt(), ordered)
    assert confounded(evidence, DRIVERS, inputs) == ["elapsed_time"]
    assert "elapsed_time" not in {c.covariate for c in candidates_of(evidence, DRIVERS, inputs)}


def test_late_touch_detection_is_no_effect() -> None:
    """Only the window that begins with the touch is shorter, by the distance that the pusher travels."""
    table = pushes(COUNT, 3)
    since = np.tile([0.0, 0.2], COUNT)
    late = np.where(since == 0.0, 0.97, 1.0)
    short = MECHANICS.displacement(table.inputs, table.duration * late)
    moved = table.outcomes + short - MECHANICS.displacement(table.inputs, table.duration)
    table = replace(table, outcomes=moved, covariates={**table.covariates, "time_since_contact": since})
    assert not searched(EXACT, table).terms


@pytest.mark.slow
def test_effects_above_the_detectable_size_are_found_and_far_smaller_ones_are_not() -> None:
    table = pushes(COUNT, 103)
    gate = gate_of(learnt(), seen(learnt(), table), DRIVERS, baseline=baseline(learnt()))
    sizes = minimum_detectable(search_with(learnt(), gate), gate.evidence, gate.inputs, 0.01, gate.baseline)
    size = sizes["contact_friction"]
    assert size["unit"] == "1"
    small, large = (
        with_effect(table, "contact_friction", DriverBasis("constant"), share * size["value"]) for share in (0.2, 1.5)
    )
    assert not searched(learnt(), small).terms
    assert searched(learnt(), large).terms


# --- residual variance ------------------------------------------------------------------------------------------------


def noise_of(
    evidence: Evidence, z: Array, alpha: float = 0.01, names: tuple[str, ...] | None = ()
) -> tuple[ChannelEffect, ...]:
    """What differs from training; names: of the covariates that are tried besides, all if None."""
    return variance_effects(learnt(), evidence, z, alpha, names=names, training=baseline(learnt()).evidence).effects


def louder_to_the_right(n: int, seed: int) -> PushTable:
    """Pushes whose noise grows with the place along x."""
    table = pushes(n, seed)
    clean = MECHANICS.displacement(table.inputs, table.duration)
    factor = np.exp(0.5 * table.covariates["slider_x"] / 0.03)
    return replace(table, outcomes=clean + factor[:, None] * (table.outcomes - clean))


@pytest.mark.slow
def test_variance_that_grows_with_a_covariate_is_not_a_mean_effect() -> None:
    louder = louder_to_the_right(COUNT, 400)
    found = searched(learnt(), louder)
    evidence = seen(learnt(), louder)
    noise = noise_of(evidence, found.unexplained, names=None)
    assert not found.terms
    assert noise[0].covariate == "slider_x"
    assert noise[0].parameters[0].value > 2.0


@pytest.mark.slow
def test_variance_that_grew_with_the_covariate_in_training_too_is_not_reported() -> None:
    model = train_model(louder_to_the_right(COUNT, 403), RIG, "gp", name="uneven", options=TrainingOptions(mean="zero"))
    evidence = seen(model, louder_to_the_right(COUNT, 404))
    assert not variance_effects(model, evidence, evidence.z, 0.01, training=baseline(model).evidence).effects
    alone = variance_effects(model, evidence, evidence.z, 0.01).effects
    assert [effect.covariate for effect in alone] == ["slider_x"]


@pytest.mark.parametrize(("noise", "low", "high"), [(2.0, 1.6, 2.5), (0.5, 0.5, 0.8)])
def test_larger_or_smaller_variance_than_in_training_is_reported_as_constant(
    noise: float, low: float, high: float
) -> None:
    """Of all outputs; the errors of the model itself do not fall with the noise."""
    table = pushes(COUNT, 402, noise=noise * NOISE)
    evidence = seen(learnt(), table)
    found = noise_of(evidence, evidence.z, names=None)
    assert (found[0].covariate, found[0].outputs) == ("model_inputs", ("dx", "dy", "dtheta"))
    assert low < found[0].parameters[0].value < high


def test_slightly_larger_variance_than_in_training_is_not_reported() -> None:
    evidence = seen(learnt(), pushes(COUNT, 401))
    assert not noise_of(evidence, evidence.z, names=None)
    slight, large = (noise_of(evidence, scale * evidence.z, 0.9) for scale in (1.05, 1.5))
    assert not slight and large[0].covariate == "model_inputs"


def test_a_window_far_off_does_not_hide_a_larger_variance() -> None:
    evidence = seen(learnt(), pushes(COUNT, 402, noise=2.0 * NOISE))
    z = evidence.z.copy()
    z[7] *= 300.0
    noise = noise_of(evidence, z)
    assert [effect.covariate for effect in noise] == ["model_inputs"]


def test_variance_of_one_output_is_reported_of_that_one() -> None:
    evidence = seen(learnt(), pushes(COUNT, 401))
    z = evidence.z * [1.0, 2.0, 1.0]
    (effect,) = noise_of(evidence, z)
    assert effect.outputs == ("dy",)
