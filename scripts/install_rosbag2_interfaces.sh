#!/bin/sh
# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

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
