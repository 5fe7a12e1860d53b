"""Validation while pushes happen, without ROS: windows on disk, running scores, completed pushes, the alarm's process.

`nodes.validator` adds topics and services; import anything from here.
"""
