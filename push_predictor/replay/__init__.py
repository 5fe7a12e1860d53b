"""Replay of a recording without ROS: clock, player, range, lateness, back-pressure and summary.

`nodes.replay` and `nodes.push_replay` add publishers and services; import anything from here.
"""
