"""The motion of a pushed slider: the true push behind the recorded one, contact with friction, and integration."""
