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

"""YAML that programs wrote, such as metadata.yaml: parsed by libyaml, a quarter of the time of PyYAML alone."""

from __future__ import annotations

from functools import cache
from typing import Any


def load_fast(text: str) -> Any:
    """The value of a YAML document, as yaml.safe_load gives it.

    Raises yaml.YAMLError without the lines that a person would need to find the mistake, and RecursionError.
    """
    import yaml

    return yaml.load(text, _loader())


@cache
def _loader() -> Any:
    import yaml
    from yaml.composer import Composer
    from yaml.constructor import SafeConstructor
    from yaml.resolver import Resolver

    try:
        from yaml.cyaml import CParser
    except ImportError:  # PyYAML was built without libyaml
        return yaml.SafeLoader

    class Loader(Composer, CParser, SafeConstructor, Resolver):
        """Events of libyaml, composed in Python: yaml.CSafeLoader overflows the stack on a deeply nested document."""

        def __init__(self, text: str) -> None:
            CParser.__init__(self, text)
            for base in (Composer, SafeConstructor, Resolver):
                base.__init__(self)

    return Loader
