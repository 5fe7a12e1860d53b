# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The Gymnasium environment `push_predictor/Push-v0`: push a slider to a goal pose, one window of a push a step.

Importing this package registers the id, for `gymnasium.make` and for `gymnasium.make_vec`:

    import gymnasium, push_predictor.gym
    env = gymnasium.make("push_predictor/Push-v0", model="square_abs.pushmodel", goal=[0.0, 0.0, 0.0])

`environments.PushEnv` documents action, observation, reward, success and arguments.
"""

from __future__ import annotations

import gymnasium

ID = "push_predictor/Push-v0"
MOST_STEPS = 100  # of an episode

gymnasium.register(
    ID,
    entry_point="push_predictor.gym.environments:PushEnv",
    vector_entry_point="push_predictor.gym.environments:PushVectorEnv",
    max_episode_steps=MOST_STEPS,
)
