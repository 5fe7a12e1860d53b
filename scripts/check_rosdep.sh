#!/bin/sh
# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# Checks without a network that rosdep resolves every dependency of the three packages on Ubuntu 24.04:
# scripts/check_rosdep.sh. It needs rosdep (`pip install rosdep`) and reads scripts/rosdep_local.yaml in place of the
# database of ROS. It installs nothing.
set -eu
cd "$(dirname "$0")/.."
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
mkdir "$place/sources"
echo "yaml file://$PWD/scripts/rosdep_local.yaml" >"$place/sources/10-local.list"
printf '%%YAML 1.1\n---\ndistributions: {}\ntype: index\nversion: 4\n' >"$place/index.yaml"
export ROSDEP_SOURCE_PATH="$place/sources" ROSDISTRO_INDEX_URL="file://$place/index.yaml" HOME="$place" ROS_HOME="$place"
export ROS_DISTRO=jazzy ROS_PYTHON_VERSION=3 ROS_VERSION=2
rosdep update >"$place/log" 2>&1 || { cat "$place/log"; exit 1; }
# rosdep stops descending at a package, and the root is one: name all three.
paths=". push_predictor_interfaces push_predictor_paper"
rosdep install --os=ubuntu:noble --simulate --reinstall --ignore-src --from-paths $paths
