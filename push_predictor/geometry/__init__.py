"""Planar geometry: angles, rigid motions, outlines of sliders."""
