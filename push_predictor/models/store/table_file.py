# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Files of tables: what a model's tables are computed from, as arrays and a JSON record in one zip archive.

A table is named by the digest of its model and by the version of this format. It is checked when it is read: its
checksums, and its predictions at some pushes against those of the model.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np

from push_predictor.errors import ModelFileError
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.arrays_record import read_arrays
from push_predictor.models.tabulated.prediction_table import TableNodes
from push_predictor.models.tabulated.table_accuracy import Probes, TableAccuracy, probed
from push_predictor.models.tabulated.tabulated_domain import domain_from_nodes
from push_predictor.models.tabulated.tabulated_model import TabulatedModel, of_targets, with_domain
from push_predictor.recordings.atomic import write_whole
from push_predictor.types import Array

FORMAT_VERSION = 5  # also to be raised when a table's values change their meaning
RECORD = "record"
CHECKED = 10  # random pushes of the domain, as many training pushes, and as many outside the domain


def write_tables(path: Path, digest: str, tabulated: TabulatedModel) -> None:
    """Write the tables of a model with this digest, none if it has none. Raises OSError."""
    arrays: dict[str, Array] = {}
    record = {"format_version": FORMAT_VERSION, "model": digest, **_base_record(tabulated, arrays)}
    if "how" not in record:
        return
    text = np.frombuffer(json.dumps(record, allow_nan=False).encode(), dtype=np.uint8)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **{RECORD: text}, **arrays)
    write_whole(path, buffer.getvalue())


def read_tables(path: Path, digest: str, model: PushModel) -> TabulatedModel | None:
    """The model with the tables of a file; None without a whole file of this model, or if they predict otherwise."""
    try:
        arrays = read_arrays(path)
        record = json.loads(arrays.pop(RECORD).tobytes().decode())
        if (record["format_version"], record["model"]) != (FORMAT_VERSION, digest):
            return None
        return _base(model, record, arrays)
    except (ModelFileError, ValueError, KeyError, TypeError, IndexError, AttributeError):
        return None


def _base_record(tabulated: TabulatedModel, arrays: dict[str, Array]) -> dict[str, Any]:
    base = tabulated.model.base
    if tabulated.domain is None or tabulated.error is None:
        return {}
    domain, nodes = tabulated.domain, tabulated.domain.table.nodes
    arrays |= {f"nodes_{k}": values for k, values in enumerate(nodes.values)}
    return {
        "how": tabulated.how,
        "ends": [domain.least.tolist(), domain.most.tolist()],
        "nodes": [nodes.cells, nodes.coarse, nodes.least],
        "error": astuple(tabulated.error),
        "probes": _probes_record(probed(of_targets(base), CHECKED)),
    }


def _base(model: PushModel, record: Mapping[str, Any], arrays: Mapping[str, Array]) -> TabulatedModel | None:
    learnt = of_targets(model.base)
    assert isinstance(learnt.predictor, GaussianProcessPredictor)
    cells, coarse, least_variances = record["nodes"]
    nodes = TableNodes(cells, coarse, least_variances, [arrays[f"nodes_{k}"] for k in range(9)])
    least, most = (np.array(end, dtype=np.float64) for end in record["ends"])
    domain = domain_from_nodes(learnt, learnt.predictor, (least, most), nodes)
    if not _probes(record["probes"]).error_of(domain).accepted:
        return None
    return with_domain(model, domain, TableAccuracy(*record["error"]))


def _probes_record(probes: Probes) -> dict[str, Any]:
    return {name: getattr(probes, name).tolist() for name in Probes.__dataclass_fields__}


def _probes(record: Mapping[str, Any]) -> Probes:
    return Probes(*(np.array(record[name]) for name in Probes.__dataclass_fields__))
