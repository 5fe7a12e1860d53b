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
interfaces=$(cd "$(dirname "$0")/../push_predictor_interfaces" && pwd)
source=$(mktemp -d)
trap 'rm -rf "$source"' EXIT
mkdir "$source/msg"
echo 'geometry_msgs/TransformStamped[] transforms' >"$source/msg/TFMessage.msg"
cp "$interfaces/ros_wheels.cmake" "$source"
for file in pyproject.toml package.xml; do
    sed -e 's/push_predictor_interfaces/tf2_msgs/' -e 's/push-predictor-interfaces/tf2-msgs/' "$interfaces/$file" >"$source/$file"
done
cat >"$source/CMakeLists.txt" <<'CMAKE'
cmake_minimum_required(VERSION 3.15...3.28)
project(tf2_msgs)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(geometry_msgs REQUIRED)
rosidl_generate_interfaces(${PROJECT_NAME} "msg/TFMessage.msg" DEPENDENCIES geometry_msgs)
ament_export_dependencies(rosidl_default_runtime)
ament_package()
CMAKE
python -m pip install --quiet --no-deps ${1:+--prefix "$1"} "$source"
