"""The forward model in plain numbers, for single pushes."""
