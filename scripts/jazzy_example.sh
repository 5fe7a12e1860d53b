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

# An ordinary Ubuntu 24.04 with ROS 2 Jazzy, from the folder of this repository: dependencies, build, and a replay
# validated by the model that ships with the package. The block in README.md is these lines; a test compares them.
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
