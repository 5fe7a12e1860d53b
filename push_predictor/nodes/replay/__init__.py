"""ROS parts of `push_replay`: parameters, player services, publishers.

Imported by `nodes.push_replay` only, except the QoS of topics.
"""
