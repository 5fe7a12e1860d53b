"""Limit surfaces: from pressure to the twist that a load drives, exact or approximate."""
