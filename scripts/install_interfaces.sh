#!/bin/sh
# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# Build a standard package of messages or services for the PyPI wheels of ROS 2, and install it into the present Python
# environment. For packages that are not on PyPI; a ROS 2 installation has them already.
#
#   scripts/install_interfaces.sh PACKAGE DEPENDENCY SOURCE [PREFIX]
#
# DEPENDENCY: the package of the fields' types. SOURCE: a folder with msg/*.msg and srv/*.srv; files are added to it.
# PREFIX: a folder to install into instead (pip's --prefix)
set -eu
package=$1 dependency=$2 source=$3 prefix=${4:-}
interfaces=$(cd "$(dirname "$0")/../push_predictor_interfaces" && pwd)
cp "$interfaces/ros_wheels.cmake" "$source"
for file in pyproject.toml package.xml; do
    sed -e "s/push_predictor_interfaces/$package/" -e "s/push-predictor-interfaces/$(echo "$package" | tr _ -)/" \
        "$interfaces/$file" >"$source/$file"
done
definitions=$(cd "$source" && find msg srv -name '*.*' 2>/dev/null | sort | sed 's/.*/"&"/' | tr '\n' ' ')
cat >"$source/CMakeLists.txt" <<CMAKE
cmake_minimum_required(VERSION 3.15...3.28)
project($package)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package($dependency REQUIRED)
rosidl_generate_interfaces(\${PROJECT_NAME} $definitions DEPENDENCIES $dependency)
ament_export_dependencies(rosidl_default_runtime)
ament_package()
CMAKE
python -m pip install --quiet --no-deps ${prefix:+--prefix "$prefix"} "$source"
