"""In which form a driver drives: the simplest that does as well as the best, by cross-validation.

What is less than one standard error below the best does as well.

Linear, logarithmic, a step with its place, quadratic, a map over the table; once or twice around for headings.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.enumeration import Candidate
from push_predictor.residuals.evidence.drivers import CATEGORIES, HEADINGS, PLACE, standard_form, two_dimensional
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.selection.cross_validation import Judged, gains_of
from push_predictor.types import Array, IntArray

STEPS = 9  # places of a step that are tried, at quantiles of the driver
SIMPLEST_FIRST = ("constant", "category", "linear", "logarithmic", "step", "periodic", "periodic, twice around",
                  "quadratic", "map")  # fmt: skip


def best_form(candidate: Candidate, table: PushTable, z: Array, basis: Array, block: IntArray) -> Judged:
    """The candidate in the simplest form whose gain is within one standard error of the best form's."""
    out = Residualizer(basis)
    left = out(z)
    forms = forms_for(candidate, table)
    tried = [Judged(c, gains_of(left, out(c.columns), block)) for c in (_in_form(candidate, f, table) for f in forms)]
    return simplest(tried)


def forms_for(candidate: Candidate, table: PushTable) -> list[DriverBasis]:
    """The forms in which a candidate's driver may enter."""
    name, form = candidate.covariate, candidate.form
    if form.name == "constant" or name in CATEGORIES:
        return [form]
    if name in HEADINGS:
        return [DriverBasis("periodic", (name,)), DriverBasis("periodic, twice around", (name,))]
    values = table.covariates[name]
    forms = [standard_form(kind, name, values) for kind in ("linear", "logarithmic", "quadratic")]
    if candidate.grows:
        forms[0] = replace(forms[0], centre=(float(values.min()),))
    forms += [DriverBasis("step", (name,), place=place) for place in _places(values)]
    if name in PLACE and all(p in table.covariates for p in PLACE):
        forms.append(two_dimensional(table))
    return forms


def simplest(tried: list[Judged]) -> Judged:
    """The simplest whose gain is less than a standard error (of the difference) below the best; ties by gain."""
    best = max(tried, key=lambda j: j.gain)
    near = [j for j in tried if best.gain - j.gain <= _error(best.gains - j.gains)]
    return min(near, key=lambda j: (SIMPLEST_FIRST.index(j.candidate.form.name), -j.gain))


def _in_form(candidate: Candidate, form: DriverBasis, table: PushTable) -> Candidate:
    return replace(candidate, form=form, values=form.values(table.covariates, len(table)))


def _places(values: Array) -> list[float]:
    """Middles between the values at even quantiles and those before them."""
    ordered = np.unique(values)
    if len(ordered) < 2:
        return []
    marks = np.quantile(values, np.arange(1, STEPS + 1) / (STEPS + 1.0))
    index = np.unique(np.clip(np.searchsorted(ordered, marks), 1, len(ordered) - 1))
    return [float(0.5 * (ordered[k - 1] + ordered[k])) for k in index]


def _error(differences: Array) -> float:
    return float(np.sqrt(len(differences)) * differences.std())
