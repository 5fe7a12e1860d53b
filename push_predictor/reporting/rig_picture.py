# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A picture of a rig to scale: outline, axes of the slider's frame, first vertex and pusher's tip, seen from above."""

from __future__ import annotations

from html import escape

import numpy as np

from push_predictor.recordings.rig import Rig
from push_predictor.types import Array

SIZE, MARGIN, LEGEND = 360.0, 70.0, 92.0  # pixels: of the slider, around it, of the text below
GREY, BLUE, RED, GREEN = "#6b6b6b", "#1f5fb4", "#c0203a", "#1a8a5a"
AXIS = 0.3  # of the slider's size: length of the drawn axes
TIP_AT = 0.06  # contact at which the tip is drawn
BARS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)  # m


def rig_svg(rig: Rig) -> str:
    """An SVG document. Its text states the sizes in mm."""
    drawn = _boundary(rig)
    reach = np.vstack([drawn, np.zeros((1, 2))])  # the origin is shown wherever it is
    low, high = reach.min(axis=0) - 2.0 * rig.pusher_radius, reach.max(axis=0) + 2.0 * rig.pusher_radius
    scale = SIZE / float(np.max(high - low))

    def at(point: Array) -> tuple[float, float]:
        return MARGIN + scale * float(point[0] - low[0]), MARGIN + scale * float(high[1] - point[1])

    width, height = (scale * (high - low) + 2.0 * MARGIN).tolist()
    width = max(width, SIZE + 2.0 * MARGIN)
    corners = " ".join(f"{x:.2f},{y:.2f}" for x, y in map(at, drawn))
    parts = [f'<polygon points="{corners}" fill="#e6eefb" stroke="{BLUE}" stroke-width="2"/>']
    length = AXIS * float(np.max(np.ptp(drawn, axis=0)))
    for name, colour, axis in (("x", RED, np.array([1.0, 0.0])), ("y", GREEN, np.array([0.0, 1.0]))):
        parts += _arrow(at(np.zeros(2)), at(length * axis), colour)
        parts.append(_text(*_beyond(at(np.zeros(2)), at(length * axis)), name, colour, "middle"))
    contact = np.array([TIP_AT])
    tip = (rig.outline.point(contact) - rig.pusher_radius * rig.outline.inward_normal(contact))[0]
    parts.append(_disc(at(tip), scale * rig.pusher_radius, "#444444"))
    first = at(rig.outline.vertices[0])
    parts.append(_disc(first, 5.0, "white", GREEN))
    parts.append(_text(first[0] + 8.0, first[1] - 9.0, "contact 0", GREEN))
    parts += _legend(rig, scale, height)
    body = "\n".join(parts)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height + LEGEND:.0f}" '
        f'width="{width:.0f}" font-family="sans-serif" font-size="14">\n'
        f"<title>{escape(rig.shape)}: outline and tip, seen from above</title>\n"
        f'<rect width="100%" height="100%" fill="white"/>\n{body}\n</svg>\n'
    )


def _boundary(rig: Rig) -> Array:
    smooth = rig.outline.semi_axes is not None
    return rig.outline.point(np.arange(180) / 180.0) if smooth else rig.outline.vertices


def _legend(rig: Rig, scale: float, top: float) -> list[str]:
    bar = max((bar for bar in BARS if scale * bar < SIZE / 3.0), default=BARS[0])
    size = 1e3 * np.ptp(_boundary(rig), axis=0)
    end = MARGIN + scale * bar
    return [
        f'<path d="M{MARGIN} {top:.1f}H{end:.1f}M{MARGIN} {top - 4:.1f}v8M{end:.1f} {top - 4:.1f}v8" stroke="black"/>',
        _text(end + 8.0, top + 5.0, f"{1e3 * bar:g} mm", "black"),
        _text(MARGIN, top + 30.0, f"{rig.shape}: {size[0]:.1f} mm along x, {size[1]:.1f} mm along y", "black"),
        _text(MARGIN, top + 50.0, f"tip radius {1e3 * rig.pusher_radius:.2f} mm (grey disc)", "black"),
        _text(MARGIN, top + 70.0, "seen from above; contacts count counter-clockwise", GREY),
    ]


def _arrow(start: tuple[float, float], end: tuple[float, float], colour: str) -> list[str]:
    along = np.subtract(end, start) / np.hypot(*np.subtract(end, start))
    across = np.array([-along[1], along[0]])
    back = np.array(end) - 10.0 * along
    head = " ".join(f"{x:.2f},{y:.2f}" for x, y in (end, back + 5.0 * across, back - 5.0 * across))
    line = f'<line x1="{start[0]:.2f}" y1="{start[1]:.2f}" x2="{back[0]:.2f}" y2="{back[1]:.2f}"'
    return [f'{line} stroke="{colour}" stroke-width="2"/>', f'<polygon points="{head}" fill="{colour}"/>']


def _beyond(start: tuple[float, float], end: tuple[float, float]) -> tuple[float, float]:
    """The place of a label: 12 pixels beyond the end of an arrow."""
    along = np.subtract(end, start) / np.hypot(*np.subtract(end, start))
    x, y = (np.array(end) + 12.0 * along).tolist()
    return x, y + 5.0


def _disc(centre: tuple[float, float], radius: float, fill: str, line: str = "black") -> str:
    place = f'cx="{centre[0]:.2f}" cy="{centre[1]:.2f}" r="{radius:.2f}"'
    return f'<circle {place} fill="{fill}" stroke="{line}" stroke-width="2"/>'


def _text(x: float, y: float, text: str, colour: str, anchor: str = "start") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}" text-anchor="{anchor}">{escape(text)}</text>'
