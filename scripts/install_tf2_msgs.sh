#!/bin/sh
# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

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
