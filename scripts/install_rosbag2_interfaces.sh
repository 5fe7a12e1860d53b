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

# Build the player services of the standard package rosbag2_interfaces (Jazzy) for the PyPI wheels of ROS 2, and install
# them into the present Python environment. With them push_replay answers clients made for `ros2 bag play`.
# The package is not on PyPI. A ROS 2 installation has it already: sudo apt install ros-jazzy-rosbag2-interfaces
#
#   scripts/install_rosbag2_interfaces.sh [PREFIX]     PREFIX: a folder to install into instead (pip's --prefix)
set -eu
source=$(mktemp -d)
trap 'rm -rf "$source"' EXIT
mkdir "$source/srv"

# The name of a service; its definition on stdin.
define() { cat >"$source/srv/$1.srv"; }

for name in Pause Resume Stop TogglePaused; do
    echo '---' | define $name
done
define IsPaused <<'SRV'
---
bool paused
SRV
define GetRate <<'SRV'
---
float64 rate
SRV
define SetRate <<'SRV'
float64 rate
---
bool success
SRV
define Play <<'SRV'
builtin_interfaces/Time start_offset
builtin_interfaces/Duration playback_duration
builtin_interfaces/Time playback_until_timestamp
---
bool success
SRV
define PlayNext <<'SRV'
---
bool success
SRV
define Burst <<'SRV'
uint64 num_messages
---
uint64 actually_burst
SRV
define Seek <<'SRV'
builtin_interfaces/Time time
---
bool success
SRV
"$(dirname "$0")/install_interfaces.sh" rosbag2_interfaces builtin_interfaces "$source" "$@"
