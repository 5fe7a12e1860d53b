# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Choice of one term among the significant candidates: its covariate, its basis and its mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from push_predictor.models.effects.covariate_range import CUMULATIVE, HEADINGS
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.recordings.table import OUTPUTS
from push_predictor.residuals.candidates.candidate import Candidate, projected
from push_predictor.residuals.candidates.coefficients import exact_fit
from push_predictor.residuals.evidence.drivers import LOCAL, OF_SESSION, standard_basis
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, Kind, controls_for
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.selection.basis_choice import best_onset, simplest_basis, with_basis
from push_predictor.residuals.selection.cross_validation import Judged, fit, judge, judged_exactly
from push_predictor.residuals.selection.naming import (
    MOST_UNEXPLAINED,
    Case,
    Naming,
    open_rivals,
    plausible,
    surely_larger,
    unexplained_share,
)
from push_predictor.residuals.selection.screening import Screened
from push_predictor.types import Array

NOT_GROWING = ("edge", *HEADINGS, *LOCAL)  # an effect that is fixed to body or world does not grow with these
MOST_JUDGED = 60  # of the significant candidates, those with the largest statistics
MOST_REFINED = 12  # of the labels, those that are tried in every basis
MOST_RIVALS = 3  # mechanisms of a whole effect that are fitted exactly
SOON = 0.03  # of the session: scale of an effect that grows early in it
BY_CHANCE = 0.05  # probability that any covariate seems to be the onset of a constant effect
MOST_NAMED = 6  # candidates along the covariate, best first, that are tried as its name
FELT = 0.15  # an output is named if its standardised shift is at least this share of the strongest output's


@dataclass(frozen=True, eq=False)
class SelectedTerm:
    """A selected candidate with its fit and its rivals.

    rivals: all that these data do not reject, the best first. p_value: family-wise. coefficients: of the candidate's
    columns. shift (n, 3): what the term explains of the standardised residuals. share: of the sum of squares of the
    standardised residual that the term explains. own: whether the term lies in the inputs of a learnt base, so that a
    refit learns it. since_training: whether a constant effect is a change since training.
    """

    best: Candidate
    rivals: tuple[Judged, ...]
    p_value: float
    coefficients: Array
    shift: Array
    share: float
    naming: Naming
    own: bool
    since_training: bool = False

    @property
    def mechanism(self) -> str | None:
        """The mechanism that the effect is named after; None if none fits, even if `best` has one that comes close."""
        return self.best.mechanism if self.naming.known else None

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs that the term shifts."""
        shift = projected(self.shift, self.best.nuisance)
        size = np.sqrt(np.mean((shift - shift.mean(axis=0) * (self.best.kind != "constant")) ** 2, axis=0))
        return tuple(name for name, felt in zip(OUTPUTS, size >= FELT * size.max(), strict=True) if felt)


@dataclass(frozen=True, eq=False)
class TermChoice:
    """Chooses terms among these candidates on these windows."""

    evidence: Evidence
    candidates: tuple[Candidate, ...]
    inputs: InputsBasis
    seed: int
    _known: dict[object, tuple[Array, Judged]] = field(default_factory=dict)  # exact fits to residuals z, with these

    @cached_property
    def residualizers(self) -> dict[Kind, Residualizer]:
        """Regression on the inputs, by kind of candidate."""
        return {kind: Residualizer(controls_for(kind, self.inputs)) for kind in get_args(Kind)}

    def own(self, candidate: Candidate) -> bool:
        """Whether a candidate lies in inputs that the base model has."""
        return candidate.kind == "constant" or (candidate.kind == "speed" and self.inputs.knows_speed)

    def best_gain(self, found: Sequence[int], screened: Screened, z: Array) -> float:
        """Largest cross-validated gain among the candidates with the largest statistics."""
        best = sorted(found, key=lambda k: -screened.statistic[k])[:MOST_NAMED]
        return max(self._judge([self.candidates[k]], self.candidates[k].kind, z)[0].gain for k in best)

    def with_gains(self, screened: Screened, z: Array) -> dict[int, Judged]:
        """The candidates with the largest statistics and their cross-validated gains, by their number."""
        best = np.argsort(-screened.statistic)[:MOST_JUDGED].tolist()
        return {k: self._judge([self.candidates[k]], self.candidates[k].kind, z)[0] for k in best}

    def term(self, found: list[int], screened: Screened, z: Array, used: set[str]) -> SelectedTerm:
        """The best of the candidates found, named; covariates of earlier terms, used, are preferred if they fit."""
        chosen = self._not_constant(sorted(found, key=lambda k: -screened.statistic[k])[:MOST_JUDGED])
        growing = self._growing(found)
        judged = self._with_onset(self._refined([_if_growing(self.candidates[k], growing) for k in chosen], z), z)
        rivals = open_rivals(judged[0], _one_each(judged[1:], judged[0], "covariate"), self._case(judged[0], z))
        driver = next((j for j in rivals if j.candidate.covariate in used), rivals[0]).candidate.covariate
        known = {j.candidate.covariate for j in rivals}
        rivals = [*rivals, *(j for j in self._early_growth(judged, z) if j.candidate.covariate not in known)]
        best, naming = self._named(judged, driver, z, growing)
        drivers = tuple(dict.fromkeys([driver, *(j.candidate.covariate for j in rivals)]))
        labels = {j.candidate.label for j in judged}
        tested = [k for k in chosen if self.candidates[k].label in labels]
        along = [k for k in tested if self.candidates[k].covariate == driver]
        p_value = min(float(screened.p_value[k]) for k in along or tested)
        return self._fitted(best, rivals, p_value, replace(naming, drivers=drivers), z)

    def _growing(self, found: Sequence[int]) -> set[str]:
        """Mechanisms found both constant, though no base can have the effect, and changing with a covariate."""
        labels = [(self.candidates[k].mechanism, self.candidates[k]) for k in found]
        constant = {name for name, c in labels if name is not None and _constant_outside_inputs(c)}
        return constant & {name for name, c in labels if name is not None and c.covariate not in NOT_GROWING}

    def _not_constant(self, found: Sequence[int]) -> list[int]:
        """Without the constant effects of growing mechanisms: they are part of the growing effect."""
        growing = self._growing(found)
        return [k for k in found if not (_constant_outside_inputs(c := self.candidates[k]) and c.mechanism in growing)]

    def _case(self, judged: Judged, z: Array) -> Case:
        return Case(z, controls_for(judged.candidate.kind, self.inputs), self.evidence.block)

    def _refined(self, candidates: Sequence[Candidate], z: Array) -> list[Judged]:
        """The best candidates by gain, each label once, in their simplest adequate basis."""
        kinds = {c.kind for c in candidates}
        judged = [j for kind in kinds for j in self._judge([c for c in candidates if c.kind == kind], kind, z)]
        first = _one_each(sorted(judged, key=lambda j: -j.gain), None, "label")[:MOST_REFINED]
        return sorted((self._with_simplest_basis(j.candidate, z) for j in first), key=lambda j: -j.gain)

    def _with_onset(self, judged: list[Judged], z: Array) -> list[Judged]:
        """With whole effects in front that surely begin with some value of a covariate, instead of being constant.

        Where a base absorbs no constant effect, the constant and the changing part of an effect are found apart.
        """
        always = self._always(judged, z)
        if always is None:
            return judged
        along = self._along_covariates(str(always.candidate.mechanism))
        surely = [j for j in self._onsets(along, z) if surely_larger(j, always, BY_CHANCE / len(along))]
        return [*surely, *judged]

    def _early_growth(self, judged: list[Judged], z: Array) -> list[Judged]:
        """Rivals of a constant effect that comes first: growths that soon end, and fit better, though not surely."""
        always = self._always(judged, z) if judged[0].candidate.basis.is_constant else None
        if always is None:
            return []
        along = self._along_covariates(str(always.candidate.mechanism))
        growing = [self._growing_from_zero(c, z) for c in along if c.covariate in CUMULATIVE]
        return [j for j in growing if j.gain > always.gain]

    def _always(self, judged: Sequence[Judged], z: Array) -> Judged | None:
        """The whole constant effect with which a constant or drifting one is compared; None where a base absorbs it."""
        first = judged[0].candidate
        if self.inputs.absorbs or not (first.basis.is_constant or first.covariate in OF_SESSION):
            return None
        whole = [self._whole(_unconditional(j.candidate), z) for j in self._constants(judged)[:MOST_RIVALS]]
        return max(whole, key=lambda j: j.gain, default=None)

    def _constants(self, judged: Sequence[Judged]) -> list[Judged]:
        """The constant effects found, if one comes first; else that of the first one's mechanism."""
        first = judged[0].candidate
        known = [j for j in judged if j.candidate.mechanism is not None and j.candidate.basis.is_constant]
        if first.basis.is_constant:
            return known
        same = [c for c in self.candidates if c.mechanism == first.mechanism and c.basis.is_constant]
        return [Judged(c, np.zeros(1)) for c in same if c.mechanism is not None]

    def _along_covariates(self, mechanism: str) -> list[Candidate]:
        """One candidate of a mechanism for each covariate along which it may set in."""
        each = {c.covariate: c for c in reversed(self.candidates) if c.mechanism == mechanism}
        return [c for c in each.values() if c.basis.name == "linear"]

    def _onsets(self, along: Sequence[Candidate], z: Array) -> list[Judged]:
        """The whole effect by its onset along each covariate, the best fitted exactly, by gain."""
        stepped = [self._by_onset(c, z) for c in along]
        best = sorted(stepped, key=lambda j: -j.gain)[:MOST_NAMED]
        return sorted((self._whole(j.candidate, z) for j in best), key=lambda j: -j.gain)

    def _growing_from_zero(self, candidate: Candidate, z: Array) -> Judged:
        """The candidate's whole effect, fitted exactly, as one that grows ever more slowly from the session's start."""
        table, values = self.evidence.table, self.evidence.table.covariates[candidate.covariate]
        basis = standard_basis("logarithmic", candidate.covariate, values)
        soon = replace(basis, scale=(SOON * float(np.ptp(values)),))
        return self._whole(with_basis(_unconditional(candidate), soon, table), z)

    def _by_onset(self, candidate: Candidate, z: Array) -> Judged:
        """The candidate's whole effect by its onset along its covariate."""
        return best_onset(_unconditional(candidate), self.evidence.table, z, self.evidence.block)

    def _whole(self, candidate: Candidate, z: Array) -> Judged:
        """The candidate fitted exactly, and judged by its whole effect; a fit serves all with the same values."""
        nothing = np.empty((len(z), 0))
        key = (candidate.mechanism, None if candidate.values is None else candidate.values.tobytes())
        known = self._known.get(key)
        if known is None or known[0] is not z:
            fitted = exact_fit(self.evidence, candidate, z, nothing)
            known = self._known[key] = z, judged_exactly(fitted, z, Residualizer(nothing), self.evidence.block)
        same, judged = replace(candidate, response=known[1].candidate.response), known[1]
        assert judged.exact is not None  # fitted above
        return replace(judged, candidate=same, exact=replace(judged.exact, candidate=same))

    def _judge(self, candidates: Sequence[Candidate], kind: Kind, z: Array) -> list[Judged]:
        return judge(candidates, z, controls_for(kind, self.inputs), self.evidence.block)

    def _with_simplest_basis(self, candidate: Candidate, z: Array) -> Judged:
        controls = controls_for(candidate.kind, self.inputs)
        return simplest_basis(candidate, self.evidence.table, z, controls, self.evidence.block)

    def _named(self, judged: Sequence[Judged], driver: str, z: Array, growing: set[str]) -> tuple[Judged, Naming]:
        """The best mechanism along a covariate, if any fits; else, without a name, it or the generic polynomial."""
        by_gain = self._along(judged, driver, z, growing)
        known = [
            j for j in by_gain if j.candidate.mechanism is not None and j.gain > 0.0 and plausible(j, self._case(j, z))
        ]
        generics = self._generics(driver, known[0].candidate.basis if known else None, z)
        unexplained = {id(j): self._unexplained(j, generics, z) for j in known}
        fitting = [j for j in known if unexplained[id(j)] <= MOST_UNEXPLAINED]
        if not fitting and generics:
            generic = max((self._with_simplest_basis(g, z) for g in generics), key=lambda j: j.gain)
            closest = known[0].candidate.mechanism if known else None
            better = known and self.inputs.learnt and surely_larger(known[0], generic)  # others: see further_steps.py
            best = known[0] if better else generic
            return best, Naming((driver,), (None,), False, min(unexplained.values(), default=1.0), closest)
        fitting = fitting or known[:1] or by_gain[:1]  # the last two if there is no generic candidate
        best = fitting[0]
        rivals = open_rivals(best, fitting[1:], self._case(best, z), self.seed)
        mechanisms = tuple(j.candidate.mechanism for j in rivals)
        return best, Naming((driver,), mechanisms, True, unexplained.get(id(best), 0.0))

    def _along(self, judged: Sequence[Judged], driver: str, z: Array, growing: set[str]) -> list[Judged]:
        """Every candidate of a covariate in its simplest adequate basis, fitted exactly, by gain."""
        first = {c.label: c for c in reversed(self.candidates)}
        along = [_if_growing(c, growing) for c in first.values() if c.covariate == driver]
        refined = {j.candidate.label: j for j in reversed(judged)}
        whole = next((j for j in judged if j.exact and j.candidate.covariate == driver), None)
        if whole:  # the others are compared with it as such
            others = [self._by_onset(c, z) for c in along if c.mechanism is not None and c.label not in refined]
            best = sorted(others, key=lambda j: -j.gain)[:MOST_RIVALS]
            return sorted([whole, *(self._whole(j.candidate, z) for j in best)], key=lambda j: -j.gain)
        linear = sorted((refined.get(c.label) or self._with_simplest_basis(c, z) for c in along), key=lambda j: -j.gain)
        exact = (self._exact(j, z) if j.gain > 0.0 and not j.exact else j for j in linear[:MOST_NAMED])
        return sorted(exact, key=lambda j: -j.gain)

    def _exact(self, judged: Judged, z: Array) -> Judged:
        """The mechanism fitted exactly; the generic polynomial as it is."""
        candidate = judged.candidate
        if candidate.mechanism is None:
            return judged
        key = (candidate.label, candidate.basis, candidate.grows)
        known = self._known.get(key)
        if known is None or known[0] is not z:
            known = self._known[key] = z, self._exactly(candidate, z)
        return known[1]

    def _exactly(self, candidate: Candidate, z: Array) -> Judged:
        found = exact_fit(self.evidence, candidate, z, controls_for(candidate.kind, self.inputs))
        return judged_exactly(found, z, self.residualizers[candidate.kind], self.evidence.block)

    def _unexplained(self, mechanism: Judged, generics: Sequence[Candidate], z: Array) -> float:
        case = self._case(mechanism, z)
        return max((unexplained_share(mechanism, generic, case, self.seed) for generic in generics), default=0.0)

    def _generics(self, driver: str, basis: DriverBasis | None, z: Array) -> list[Candidate]:
        """The generic polynomial along a covariate: in the mechanism's basis, or in all screening bases."""
        same = [c for c in self.candidates if c.mechanism is None and c.covariate == driver]
        if same and basis is not None and basis.drivers:
            return [replace(same[0], basis=basis, values=basis.values(self.evidence.table.covariates, len(z)))]
        return same or [c for c in self.candidates if c.mechanism is None and c.kind == "constant"]

    def _fitted(self, best: Judged, rivals: Sequence[Judged], p_value: float, naming: Naming, z: Array) -> SelectedTerm:
        chosen, residualizer = best.candidate, self.residualizers[best.candidate.kind]
        target, columns = best.exact.target if best.exact else z, residualizer(chosen.columns)
        coefficients = fit(columns, residualizer(target))
        shift = best.exact.shift if best.exact else chosen.plain @ coefficients
        left = z - (shift if best.exact else chosen.columns @ coefficients)
        share = 1.0 - float(np.sum(residualizer(left) ** 2) / np.sum(residualizer(z) ** 2))
        others = tuple(j for j in rivals if j.candidate.label != chosen.label)
        own = self.inputs.absorbs and self.own(chosen)
        return SelectedTerm(chosen, (best, *others), p_value, coefficients, shift, share, naming, own)


def _constant_outside_inputs(candidate: Candidate) -> bool:
    return candidate.kind == "driven" and candidate.basis.is_constant


def _unconditional(candidate: Candidate) -> Candidate:
    """The candidate projected off nothing: its whole effect."""
    return replace(candidate, nuisance=None, nuisance_growing=None)


def _if_growing(candidate: Candidate, growing: set[str]) -> Candidate:
    """A candidate of a growing mechanism, with the constant effect of that mechanism included."""
    driven = candidate.mechanism in growing and not _constant_outside_inputs(candidate)
    return replace(candidate, nuisance=candidate.nuisance_growing) if driven else candidate


def _one_each(judged: Sequence[Judged], best: Judged | None, what: Literal["covariate", "label"]) -> list[Judged]:
    """The first of each covariate (or label), without that of the best."""
    first: dict[object, Judged] = {}
    for each in judged:
        first.setdefault(getattr(each.candidate, what), each)
    return [j for key, j in first.items() if best is None or key != getattr(best.candidate, what)]
