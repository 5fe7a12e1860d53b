"""The ROS side of `push_replay`: parameters, player services, publishers.

Imported by `nodes.push_replay` only, except `message_class`.
"""
