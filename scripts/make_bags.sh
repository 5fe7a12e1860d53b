#!/bin/sh
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

# Writes the recordings in bags/ again: scripts/make_bags.sh [NAME...]. Seeds are fixed, so the files are identical.
set -eu
cd "$(dirname "$0")/.."
python="${PYTHON:-.venv/bin/python}"
names="${*:-square_abs_train square_abs_test square_abs_repeats ellipse_plywood circle_pu hexagon_delrin}"
for name in $names; do rm -rf "bags/$name"; done
PYTHONPATH=. exec "$python" -m push_predictor.simulation.standard_bags --out bags $names
