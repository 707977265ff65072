"""What tennis players wear and how they are built; colours are sRGB in [0, 1]."""

import colorsys
from dataclasses import dataclass

import numpy as np

from blender_addon.datagen.appearance import HAIRS, SHOES, SKINS, Colour, jitter

_SHORTS = (
    (0.95, 0.95, 0.94),
    (0.12, 0.13, 0.17),
    (0.16, 0.22, 0.42),
    (0.62, 0.62, 0.60),
    (0.45, 0.13, 0.18),
    (0.20, 0.38, 0.36),
)


@dataclass(frozen=True)
class Kit:
    """Colours of a player's parts, and the player's build.

    Attributes:
        shirt, shorts, skin, hair, shoes, socks, racket, strings: Colours.
        skirt: Shorts are a skirt.
        long_hair: Tied at the back.
        stature: Height as a share of 1.80 m.
        build: Width as a share of the usual.
    """

    shirt: Colour
    shorts: Colour
    skin: Colour
    hair: Colour
    shoes: Colour
    socks: Colour
    racket: Colour
    strings: Colour
    skirt: bool
    long_hair: bool
    stature: float
    build: float


def draw_kits(rng: np.random.Generator, count: int) -> tuple[Kit, ...]:
    """Dress `count` players; coloured shirts lie apart from one another on the hue circle."""
    first_hue = rng.random()
    hues = [(first_hue + k / count + rng.uniform(-0.2, 0.2) / count) % 1.0 for k in range(count)]
    return tuple(_draw_kit(rng, hue) for hue in hues)


def uniform_kit() -> Kit:
    """The one player of `static-court`."""
    return Kit(
        shirt=(0.93, 0.80, 0.22),
        shorts=_SHORTS[2],
        skin=SKINS[1],
        hair=HAIRS[1],
        shoes=SHOES[0],
        socks=(0.95, 0.95, 0.95),
        racket=(0.14, 0.14, 0.16),
        strings=(0.90, 0.88, 0.74),
        skirt=False,
        long_hair=False,
        stature=1.0,
        build=1.0,
    )


def _draw_kit(rng: np.random.Generator, hue: float) -> Kit:
    white = rng.random() < 0.2
    saturation, value = rng.uniform(0.65, 0.95), rng.uniform(0.72, 0.98)
    shirt = (0.95, 0.95, 0.95) if white else colorsys.hsv_to_rgb(hue, saturation, value)
    skirt = bool(rng.random() < 0.4)
    return Kit(
        shirt=shirt,
        shorts=jitter(rng, _SHORTS[rng.integers(len(_SHORTS))]),
        skin=jitter(rng, SKINS[rng.integers(len(SKINS))], 0.02),
        hair=jitter(rng, HAIRS[rng.integers(len(HAIRS))], 0.02),
        shoes=SHOES[rng.integers(len(SHOES))],
        socks=(0.95, 0.95, 0.95),
        racket=((0.14, 0.14, 0.16), (0.75, 0.20, 0.18), (0.20, 0.32, 0.62))[rng.integers(3)],
        strings=(0.90, 0.88, 0.74),
        skirt=skirt,
        long_hair=skirt or bool(rng.random() < 0.1),
        stature=rng.uniform(0.96, 1.04),
        build=rng.uniform(0.95, 1.06),
    )
