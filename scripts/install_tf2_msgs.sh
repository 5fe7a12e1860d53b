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

# Build the standard package tf2_msgs for the PyPI wheels of ROS 2, and install it into the present Python environment.
# It is not on PyPI. A ROS 2 installation has it already: sudo apt install ros-jazzy-tf2-msgs
#
#   scripts/install_tf2_msgs.sh [PREFIX]     PREFIX: a folder to install into instead (pip's --prefix)
set -eu
source=$(mktemp -d)
trap 'rm -rf "$source"' EXIT
mkdir "$source/msg"
echo 'geometry_msgs/TransformStamped[] transforms' >"$source/msg/TFMessage.msg"
"$(dirname "$0")/install_interfaces.sh" tf2_msgs geometry_msgs "$source" "$@"
