"""Validation while pushes happen, without ROS: session, buffers, stream sync, running scores, files, processes.

`nodes.validator` adds topics and services; import anything from here.
"""
