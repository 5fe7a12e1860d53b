#!/bin/sh
# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# An ordinary Ubuntu 24.04 with ROS 2 Jazzy, from the folder of this repository: dependencies, build, and a replay
# validated by the model that ships with the package. README.md names it.
set -e
. /opt/ros/jazzy/setup.sh
sudo apt install -y python3-pip python3-rosdep python3-colcon-common-extensions
[ -d /etc/ros/rosdep/sources.list.d ] || sudo rosdep init
rosdep update
export PIP_BREAK_SYSTEM_PACKAGES=1
rosdep install -y --ignore-src --from-paths . push_predictor_interfaces
colcon build --packages-up-to push_predictor
. install/setup.sh
ros2 run push_predictor push_predictor doctor
ros2 launch push_predictor push_predictor.launch.py recording:="$PWD/bags/square_abs_test" model:=default rate:=10
