"""Whether the page can be read: contrast by WCAG 2, in light and dark."""

import re
from pathlib import Path

import pytest

import offboard.viewer

CSS = (Path(offboard.viewer.__file__).parent / "page" / "style.css").read_text()
TEXT, GRAPHICS = 4.5, 3.0
"""Smallest contrast of text and of what else must be seen (success criteria 1.4.3 and 1.4.11)."""
PAIRS = [
    *((text, ground, TEXT) for text in ("text", "quiet", "goal") for ground in ("card", "page")),
    ("warning-text", "warning", TEXT),
    ("white", "stop", TEXT),
    *(
        (drawn, "card", GRAPHICS)
        for drawn in ("robot", "goal", "horizon", "set", "segment", "stop", "focus", "quiet")
    ),
    ("focus", "page", GRAPHICS),
]


def palette(block):
    """Return the colours that a block of the style sheet sets, each as (r, g, b) in [0, 1]."""
    found = re.findall(r"--([\w-]+): #([0-9a-f]{6});", block)
    return {name: [int(code[k : k + 2], 16) / 255 for k in (0, 2, 4)] for name, code in found}


LIGHT, DARK = (palette(block) for block in re.findall(r":root \{(.*?)\}", CSS, re.S)[:2])


def luminance(colour):
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


@pytest.mark.parametrize("scheme", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize(("front", "ground", "least"), PAIRS)
def test_what_must_be_read_or_seen_stands_out(scheme, front, ground, least):
    colours = scheme | {"white": [1.0, 1.0, 1.0]}
    dim, bright = sorted(luminance(colours[name]) for name in (front, ground))
    assert (bright + 0.05) / (dim + 0.05) >= least


def test_both_schemes_set_the_same_colours():
    assert LIGHT.keys() == DARK.keys()
    assert len(LIGHT) >= 10
