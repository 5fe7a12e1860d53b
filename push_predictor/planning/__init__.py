"""Planning with single predictions: slider poses in the world, rollouts of push sequences, the choice of a push.

Import `around_obstacles`, `choose`, `goal`, `repertoire`, `rollout`, `scene`, `slider_pose` and `targets`; the other
modules are their parts.
"""
