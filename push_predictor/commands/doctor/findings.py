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

"""The result of one check of the installation."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal, TypeAlias

State: TypeAlias = Literal["ok", "note", "missing"]


@dataclass(frozen=True)
class Finding:
    """Result of one check. missing: something required is absent; note: something optional is.

    why states what this means, remedy how to fix it, as a command where possible. Both are empty if all is well.
    """

    name: str
    state: State
    found: str
    why: str = ""
    remedy: str = ""

    @property
    def lines(self) -> list[str]:
        """Lines to print: the finding, what it means, how to fix it."""
        below = [f"{'':25s}{text}" for text in (self.why, self.remedy and f"-> {self.remedy}") if text]
        return [f"{self.state:8s} {self.name:15s} {self.found}", *below]

    def record(self) -> dict[str, str]:
        """The entry in the JSON."""
        return asdict(self)
