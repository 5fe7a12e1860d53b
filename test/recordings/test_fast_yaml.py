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

"""YAML parsed by libyaml: the values of yaml.safe_load, and an error where that has one."""

from __future__ import annotations

import pytest
import yaml
from repository import REPOSITORY

from push_predictor.recordings.bag.fast_yaml import load_fast

DOCUMENTS = ("", "a: 1_000", "a: 2026-01-01", "a: &x [1.5, yes]\nb: *x", "<<: {a: 1}\nb: ~", "a: |\n  - x\n   y\n")


def test_values_are_those_of_safe_load() -> None:
    metadata = [path.read_text() for path in sorted((REPOSITORY / "bags").glob("*/metadata.yaml"))]
    assert metadata
    for text in (*metadata, *DOCUMENTS):
        assert load_fast(text) == yaml.safe_load(text)


@pytest.mark.parametrize("text", ["a: b: c", "x: [1, 2", "a: 1\n\tb: 2", "\x00", "a: !!python/object:os.system x"])
def test_what_safe_load_refuses_is_refused(text: str) -> None:
    with pytest.raises(yaml.YAMLError):
        load_fast(text)


@pytest.mark.parametrize("opening", ["[", "{a: ", "- "])
def test_a_document_that_is_nested_too_deeply_is_an_error(opening: str) -> None:
    """Of the interpreter or, from 0.2.6 on, of libyaml: a parser that overflows the stack would end the process."""
    with pytest.raises((RecursionError, yaml.YAMLError)):
        load_fast(opening * 20_000)
