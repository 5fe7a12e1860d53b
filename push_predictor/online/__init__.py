"""Validation while pushes happen, without ROS: session, buffers, stream sync, running scores, files, alarm process.

`nodes.validator` adds topics and services; import anything from here.
"""
