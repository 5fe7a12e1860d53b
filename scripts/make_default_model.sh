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

# Retrains the model shipped with the package on the simulated recording: scripts/make_default_model.sh
set -eu
cd "$(dirname "$0")/.."
PYTHONPATH=. exec "${PYTHON:-.venv/bin/python}" -m push_predictor.cli train bags/square_abs_train --kind vhgp --mean zero \
  --out resource/simulated_square_abs.pushmodel --force
