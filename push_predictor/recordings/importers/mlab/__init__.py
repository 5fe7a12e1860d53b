"""Importers of the MLab's push logs (Zhou et al. 2016) and of its ROS 1 bags.

Import `push_logs` and `bag`; the other modules contain the rig, the force axes and the parser.
"""
