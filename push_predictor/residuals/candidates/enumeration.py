"""Mechanism x driver: everything that is tried, in units of the residual's standard deviation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import mechanism_named
from push_predictor.models.mechanisms import LIBRARY
from push_predictor.residuals.candidates.nuisance import Nuisance
from push_predictor.residuals.evidence.drivers import CONSTANT, HEADINGS, screening_forms
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, Kind
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.standardised import Evidence, whitened_response
from push_predictor.types import Array

HEADED = "push_heading"  # drives what has a direction in the world by itself
SIDES = "edge"  # tells apart what a base folds
SPEED = "velocity"
ENTANGLED = 0.2  # share of a driver that the inputs leave over; below it nothing is said of the driver
OUTSIDE = 0.5  # share of a constant effect that a base which folds the sides cannot have learnt: then sides drive it


@dataclass(frozen=True, eq=False)
class Candidate:
    """A mechanism (None: the generic fall-back) with a driver in one form.

    response (n, 3, p): whitened outcome per unit of the parameters; values (n, m): what the form multiplies it by.
    beside (3 n, q): orthonormal, what is taken out of the columns, because it comes without the effect; see nuisance.
    whole (3 n, q): the same, but for what its mechanism does without the driver. own: whether the driver is a function
    of the inputs that a learnt base has, as the side is where it folds none.
    """

    mechanism: str | None
    covariate: str
    form: DriverBasis
    response: Array
    values: Array | None = None
    beside: Array | None = None
    whole: Array | None = None
    own: bool = False

    @cached_property
    def columns(self) -> Array:
        """Whitened columns (n, 3, p * m), p first, less what comes without the effect."""
        plain = self.plain
        if self.beside is None:
            return plain
        flat = plain.reshape(len(self.beside), -1)
        return np.asarray(flat - self.beside @ (self.beside.T @ flat)).reshape(plain.shape)

    @property
    def plain(self) -> Array:
        """Whitened columns (n, 3, p * m), p first: what the effect itself does."""
        if self.values is None:
            return self.response
        n = len(self.response)
        return (self.response[:, :, :, None] * self.values[:, None, None, :]).reshape(n, 3, -1)

    @property
    def kind(self) -> Kind:
        """Whether something drives it that is no input of a base, or the speed, or nothing (or contact and angle)."""
        if self.covariate == CONSTANT or self.own:
            return "constant"
        return "speed" if self.covariate == SPEED else "driven"

    @property
    def grows(self) -> bool:
        """Whether what the mechanism does without the driver is in it as well: it was not there at first."""
        return self.kind == "driven" and self.whole is not None and self.beside is self.whole

    @property
    def label(self) -> tuple[str | None, str]:
        """What a reader calls it."""
        return self.mechanism, self.covariate


def candidates_of(
    evidence: Evidence, names: Sequence[str] | None = None, basis: InputsBasis | None = None
) -> list[Candidate]:
    """All candidates: every mechanism whose needs are recorded, and the fall-back, with every driver and with none.

    basis: of the model's inputs, by which a constant effect that differs between the sides it folds is told apart.
    Drivers that go with the inputs are left out, see entangled.
    """
    apart = set() if basis is None else set(entangled(evidence, names, basis))
    forms = [
        (CONSTANT, DriverBasis("constant")),
        *(f for f in screening_forms(evidence.table, names) if f[0] not in apart),
    ]
    values = [form.values(evidence.table.covariates, len(evidence.table)) for _, form in forms]
    responses = {mechanism: whitened_response(evidence, mechanism) for mechanism in usable(evidence)}
    found: list[Candidate] = []
    told = basis is not None and basis.learnt and not basis.folds
    for mechanism, response in responses.items():
        for (covariate, form), column in zip(forms, values, strict=True):
            if covariate in HEADINGS and _headed(mechanism):
                continue  # turned back by the heading, it would be one of the body, by a wrong name
            driver = _constant_driver(mechanism, response, basis) if covariate == CONSTANT else covariate
            found.append(Candidate(mechanism, driver, form, response, column, own=covariate == SIDES and told))
    if basis is None:
        return found
    nuisance = Nuisance(evidence, basis, [name for name in responses if name is not None], responses.__getitem__)
    return [
        replace(c, beside=nuisance.beside(*c.label, c.form, c.kind), whole=nuisance.whole(*c.label, c.kind))
        for c in found
    ]


def entangled(evidence: Evidence, names: Sequence[str] | None, basis: InputsBasis) -> list[str]:
    """Drivers that these pushes do not tell from contact and angle: time, where the pushes were done in their order.

    What a base gets wrong in its own inputs would be put down to them.
    """
    found, out = [], Residualizer(basis.columns)
    for name in dict.fromkeys(name for name, _ in screening_forms(evidence.table, names)):
        if name in (SIDES, SPEED):
            continue  # functions of the inputs, judged as such
        values = evidence.table.covariates[name]
        centred = (values - values.mean())[:, None]
        if np.sum(out(centred) ** 2) < ENTANGLED * np.sum(centred**2):
            found.append(name)
    return found


def usable(evidence: Evidence) -> list[str | None]:
    """The mechanisms whose needs are recorded, and None, the fall-back."""
    recorded = evidence.table.covariates
    return [*(m.name for m in LIBRARY if all(need in recorded for need in m.needs)), None]


def candidate(evidence: Evidence, mechanism: str | None, covariate: str, form: DriverBasis) -> Candidate:
    """One candidate on these windows."""
    values = form.values(evidence.table.covariates, len(evidence.table))
    return Candidate(mechanism, covariate, form, whitened_response(evidence, mechanism), values)


def _constant_driver(mechanism: str | None, response: Array, basis: InputsBasis | None) -> str:
    if _headed(mechanism):
        return HEADED
    if basis is None or not basis.folds:
        return CONSTANT
    outside = np.sum(Residualizer(basis.columns)(response) ** 2) / max(np.sum(response**2), np.finfo(float).tiny)
    return SIDES if outside > OUTSIDE else CONSTANT


def _headed(mechanism: str | None) -> bool:
    return mechanism is not None and "slider_heading" in mechanism_named(mechanism).needs
