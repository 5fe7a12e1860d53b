# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Candidates: every mechanism with every covariate, as columns of a regression in units of the predicted deviation.

Candidates are projected off columns that occur without the effect (Nuisance). A touch that is detected early or late
shifts the window that begins with it, not the slider: the contact with a heavier slider is detected sooner. And an
effect that depends on a covariate must explain more than the constant effects of all mechanisms: a centre of friction
that was always off must not be put down to the side that was pushed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from push_predictor.models.effects.covariates import HEADINGS
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import products
from push_predictor.models.mechanics.ladder import all_supports_known
from push_predictor.models.mechanics.parameters import QUASI_STATIC
from push_predictor.models.mechanisms import LIBRARY, REFINEMENTS, mechanism_named
from push_predictor.residuals.evidence.drivers import CONSTANT, at_touch, screening_bases
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, Kind
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.standardised import Evidence, whitened_response
from push_predictor.types import Array

SPEED = "velocity"
HEADED = "push_heading"  # covariate of mechanisms that are fixed to the world
SIDES = "edge"  # covariate that separates the sides which a base folds onto one
CONFOUNDED = 0.2  # share of a covariate that the inputs do not explain; below it the covariate is not tried
OUTSIDE = 0.5  # share of a constant effect that a base which folds the sides cannot learn; above it the sides matter
FELT = 1e-3  # of a direction's length; less than this, regressed on the inputs, is numerical noise
Key = tuple[bool, bool, str | None, Kind]


@dataclass(frozen=True, eq=False)
class Candidate:
    """A mechanism (None: the generic polynomial) whose strength depends on a covariate through one basis.

    response (n, 3, p): standardised outcome per unit of the parameters. values (n, m): the basis at the windows.
    nuisance (3 n, q): orthonormal columns that the candidate is projected off, see Nuisance. own: whether the
    covariate is a function of the inputs of a learnt base, as the side is where the base folds none.
    """

    mechanism: str | None
    covariate: str
    basis: DriverBasis
    response: Array
    values: Array | None = None
    nuisance: Array | None = None
    own: bool = False

    @property
    def columns(self) -> Array:
        """Standardised columns (n, 3, p * m), p first, projected off the nuisance."""
        return projected(self.plain, self.nuisance)

    @property
    def plain(self) -> Array:
        """Standardised columns (n, 3, p * m), p first: the effect itself."""
        if self.values is None:
            return self.response
        return products(self.response, self.values)

    @property
    def size(self) -> int:
        """Number of coefficients, p * m."""
        return int(self.response.shape[2] * (1 if self.values is None else self.values.shape[1]))

    @property
    def kind(self) -> Kind:
        """Whether the effect depends on another covariate, on the speed, or on the inputs alone."""
        if self.covariate == CONSTANT or self.own:
            return "constant"
        return "speed" if self.covariate == SPEED else "driven"

    @property
    def label(self) -> tuple[str | None, str]:
        """Mechanism and covariate, whatever the basis."""
        return self.mechanism, self.covariate

    def same_as(self, other: Candidate) -> bool:
        """Whether two are the same effect in the same form."""
        return self.label == other.label and self.basis == other.basis


def projected(values: Array, nuisance: Array | None) -> Array:
    """Values (n, 3, ...) projected off orthonormal columns (3 n, q)."""
    if nuisance is None:
        return values
    flat = values.reshape(len(nuisance), -1)
    return np.asarray(flat - nuisance @ (nuisance.T @ flat)).reshape(values.shape)


def candidate(evidence: Evidence, mechanism: str | None, covariate: str, basis: DriverBasis) -> Candidate:
    """One candidate on these windows, projected off nothing."""
    values = basis.values(evidence.table.covariates, len(evidence.table))
    return Candidate(mechanism, covariate, basis, whitened_response(evidence, mechanism), values)


def candidates_of(evidence: Evidence, names: Sequence[str] | None, inputs: InputsBasis) -> list[Candidate]:
    """Every mechanism whose needs are recorded, and the generic polynomial, with every covariate and with none.

    names: covariates to try, all that vary if None. inputs: a constant effect that differs between sides which the base
    folds gets the covariate "edge". Confounded covariates are skipped.
    """
    skipped = set(confounded(evidence, names, inputs))
    bases = [(CONSTANT, DriverBasis("constant"))]
    bases += [pair for pair in screening_bases(evidence.table, names) if pair[0] not in skipped]
    own_sides = inputs.learnt and not inputs.folds
    found = [
        replace(each, own=each.covariate == SIDES and own_sides)
        for mechanism in usable(evidence)
        for each in _of_mechanism(evidence, mechanism, bases, inputs)
    ]
    responses = {c.mechanism: c.response for c in found}
    mechanisms = [name for name in responses if name is not None]
    nuisance = Nuisance(evidence, inputs, mechanisms, responses.__getitem__)
    return [replace(c, nuisance=nuisance.of_change(*c.label, c.basis, c.kind)) for c in found]


def confounded(evidence: Evidence, names: Sequence[str] | None, inputs: InputsBasis) -> list[str]:
    """Covariates that the model's inputs explain in these pushes, such as time if pushes were made in order of angle.

    The search would blame them for errors of the base in its own inputs.
    """
    found, residualizer = [], inputs.residualizers["driven"]
    for name in dict.fromkeys(name for name, _ in screening_bases(evidence.table, names)):
        if name in (SIDES, SPEED):
            continue  # functions of the inputs, judged as such
        values = evidence.table.covariates[name]
        centred = (values - values.mean())[:, None]
        if np.sum(residualizer(centred) ** 2) < CONFOUNDED * np.sum(centred**2):
            found.append(name)
    return found


def usable(evidence: Evidence) -> list[str | None]:
    """The mechanisms whose needs are recorded and that can act at these speeds, and None for the generic polynomial."""
    recorded = evidence.table.covariates
    slow = float(evidence.table.inputs[:, 0].max()) < QUASI_STATIC
    found = (m.name for m in LIBRARY if all(need in recorded for need in m.needs))
    return [*(name for name in found if not (slow and name == "inertia")), None]


def constant_refinements(evidence: Evidence) -> dict[str | None, str]:
    """By mechanism that refines the library's and that these windows can show, the covariate of its constant effect."""
    mechanics, table = evidence.mechanics.mechanics, evidence.table
    known = mechanics.support is not None or all_supports_known(mechanics, table.covariates)
    return {
        m.name: HEADED if headed(m.name) else CONSTANT
        for m in REFINEMENTS
        if all(need in table.covariates for need in m.needs) and not (known and m.name == "rim_pressure")
    }


def _of_mechanism(
    evidence: Evidence, mechanism: str | None, bases: Sequence[tuple[str, DriverBasis]], inputs: InputsBasis
) -> list[Candidate]:
    """Candidates of one mechanism; all share one array of its response."""
    response = whitened_response(evidence, mechanism)
    found = []
    for covariate, basis in bases:
        if covariate in HEADINGS and headed(mechanism):
            continue  # times the heading, it would be an effect fixed to the body under a wrong name
        driver = _constant_driver(mechanism, response, inputs) if covariate == CONSTANT else covariate
        values = basis.values(evidence.table.covariates, len(evidence.table))
        found.append(Candidate(mechanism, driver, basis, response, values))
    return found


def _constant_driver(mechanism: str | None, response: Array, inputs: InputsBasis) -> str:
    if headed(mechanism):
        return HEADED
    if not inputs.folds:
        return CONSTANT
    outside = np.sum(inputs.residualizers["driven"](response) ** 2) / max(np.sum(response**2), np.finfo(float).tiny)
    return SIDES if outside > OUTSIDE else CONSTANT


def headed(mechanism: str | None) -> bool:
    """Whether the response of a mechanism depends on the slider's heading."""
    return mechanism is not None and "slider_heading" in mechanism_named(mechanism).needs


@dataclass(frozen=True, eq=False)
class Nuisance:
    """The nuisance columns of candidates on these windows.

    mechanisms: all that are usable. response: the standardised response (n, 3, p) of one.
    """

    evidence: Evidence
    inputs: InputsBasis
    mechanisms: Sequence[str]
    response: Callable[[str | None], Array]
    known: dict[Key, Array | None] = field(default_factory=dict)

    def of_change(self, mechanism: str | None, covariate: str, basis: DriverBasis, kind: Kind) -> Array | None:
        """Orthonormal columns (3 n, q) for a candidate that changes an effect which may exist anyway; None if none."""
        own = mechanism if basis.is_constant else None
        key = kind != "driven", kind != "constant", own, kind
        if key not in self.known:
            self.known[key] = self._columns(*key)
        return self.known[key]

    def _columns(self, touch: bool, constants: bool, kept: str | None, kind: Kind) -> Array | None:
        parts = [self._late_touch] if touch else []
        if constants:
            parts += [self.response(name) for name in self.mechanisms if name != kept]
        columns = np.concatenate(parts, axis=2) if parts else np.empty((len(self.evidence.table), 3, 0))
        return _orthonormal(columns, self.inputs.residualizers[kind])

    @cached_property
    def _late_touch(self) -> Array:
        return whitened_response(self.evidence, "pusher_travel") * at_touch(self.evidence.table)[:, None, None]


def _orthonormal(columns: Array, residualizer: Residualizer) -> Array | None:
    before = columns.reshape(3 * len(columns), -1)
    size = np.linalg.norm(before, axis=0)
    kept = size > 0.0
    if not kept.any():
        return None
    residual = residualizer(columns).reshape(before.shape)[:, kept] / size[kept]
    # Of the products: a tenth of the time of a singular value decomposition, and exact enough for values above FELT.
    squares, turn = np.linalg.eigh(residual.T @ residual)
    felt = squares > FELT**2
    return np.asarray(residual @ turn[:, felt] / np.sqrt(squares[felt])) if felt.any() else None
