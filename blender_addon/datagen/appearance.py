"""Colours of `duel`: court, wall and sky palettes, and what the two people wear.

Every colour here is display-referred sRGB in [0, 1]; `linear` converts for the renderer.
"""

import colorsys
from dataclasses import dataclass

import numpy as np

Colour = tuple[float, float, float]

# inner court, outer court
_COURTS = (
    ((0.20, 0.42, 0.70), (0.27, 0.55, 0.36)),
    ((0.74, 0.42, 0.28), (0.58, 0.31, 0.22)),
    ((0.33, 0.62, 0.34), (0.23, 0.45, 0.27)),
    ((0.48, 0.36, 0.62), (0.33, 0.52, 0.62)),
    ((0.83, 0.70, 0.48), (0.62, 0.50, 0.36)),
    ((0.42, 0.46, 0.52), (0.66, 0.34, 0.32)),
)
# wall, its panels
_WALLS = (
    ((0.16, 0.32, 0.36), ((0.80, 0.74, 0.30), (0.28, 0.52, 0.60), (0.72, 0.36, 0.30))),
    ((0.62, 0.60, 0.56), ((0.24, 0.34, 0.56), (0.78, 0.76, 0.72), (0.30, 0.46, 0.34))),
    ((0.26, 0.24, 0.38), ((0.72, 0.46, 0.62), (0.38, 0.40, 0.62), (0.82, 0.66, 0.42))),
    ((0.55, 0.36, 0.26), ((0.82, 0.72, 0.56), (0.36, 0.24, 0.20), (0.34, 0.52, 0.50))),
)
# horizon, zenith
_SKIES = (
    ((0.80, 0.88, 0.95), (0.45, 0.64, 0.88)),
    ((0.94, 0.86, 0.76), (0.58, 0.66, 0.84)),
    ((0.82, 0.84, 0.86), (0.64, 0.69, 0.75)),
    ((0.72, 0.86, 0.88), (0.32, 0.55, 0.74)),
)
SKINS = ((0.96, 0.80, 0.69), (0.87, 0.67, 0.52), (0.70, 0.49, 0.35), (0.46, 0.31, 0.23))
HAIRS = ((0.12, 0.09, 0.08), (0.36, 0.22, 0.13), (0.82, 0.66, 0.36), (0.58, 0.56, 0.54))
_TROUSERS = (
    (0.14, 0.16, 0.24),
    (0.86, 0.85, 0.82),
    (0.25, 0.36, 0.58),
    (0.50, 0.42, 0.32),
    (0.24, 0.34, 0.24),
    (0.42, 0.18, 0.24),
)
SHOES = ((0.93, 0.92, 0.90), (0.15, 0.15, 0.17), (0.80, 0.25, 0.20))


@dataclass(frozen=True)
class Surroundings:
    """Colours of everything that stands still."""

    inner: Colour
    outer: Colour
    line: Colour
    wall: Colour
    panels: tuple[Colour, ...]
    horizon: Colour
    zenith: Colour


@dataclass(frozen=True)
class Outfit:
    """Colours of one person."""

    shirt: Colour
    trousers: Colour
    skin: Colour
    hair: Colour
    shoes: Colour


def draw_surroundings(rng: np.random.Generator) -> Surroundings:
    """Choose court, wall and sky palettes, each colour slightly jittered."""
    inner, outer = _COURTS[rng.integers(len(_COURTS))]
    wall, panels = _WALLS[rng.integers(len(_WALLS))]
    horizon, zenith = _SKIES[rng.integers(len(_SKIES))]
    turn = int(rng.integers(len(panels)))
    panels = panels[turn:] + panels[:turn]
    return Surroundings(
        inner=jitter(rng, inner),
        outer=jitter(rng, outer),
        line=(0.93, 0.93, 0.91),
        wall=jitter(rng, wall),
        panels=tuple(jitter(rng, panel) for panel in panels),
        horizon=jitter(rng, horizon, 0.02),
        zenith=jitter(rng, zenith, 0.02),
    )


def draw_outfits(rng: np.random.Generator, count: int) -> tuple[Outfit, ...]:
    """Dress `count` people; shirts cover the hue circle and lie apart from one another on it."""
    first_hue = rng.random()
    hues = [(first_hue + k / count + rng.uniform(-0.2, 0.2) / count) % 1.0 for k in range(count)]
    return tuple(_draw_outfit(rng, hue) for hue in hues)


def linear(colour: Colour) -> tuple[float, float, float, float]:
    """Scene-linear RGBA of a display-referred sRGB colour (piecewise sRGB curve)."""
    c = np.asarray(colour, dtype=np.float64)
    rgb = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return float(rgb[0]), float(rgb[1]), float(rgb[2]), 1.0


def jitter(rng: np.random.Generator, colour: Colour, spread: float = 0.035) -> Colour:
    """A colour near the given one, each channel moved by up to `spread`."""
    moved = np.clip(np.asarray(colour) + rng.uniform(-spread, spread, 3), 0.02, 0.98)
    return float(moved[0]), float(moved[1]), float(moved[2])


def _draw_outfit(rng: np.random.Generator, hue: float) -> Outfit:
    shirt = colorsys.hsv_to_rgb(hue, rng.uniform(0.70, 0.95), rng.uniform(0.75, 0.98))
    return Outfit(
        shirt=shirt,
        trousers=jitter(rng, _TROUSERS[rng.integers(len(_TROUSERS))]),
        skin=jitter(rng, SKINS[rng.integers(len(SKINS))], 0.02),
        hair=jitter(rng, HAIRS[rng.integers(len(HAIRS))], 0.02),
        shoes=SHOES[rng.integers(len(SHOES))],
    )
