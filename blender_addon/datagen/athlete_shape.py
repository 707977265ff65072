"""The body of a tennis player: lofted tubes around a skeleton, pure numpy.

Rest pose, in metres: standing on the origin, Z up, facing -Y, arms hanging; the player's left is
+X; 1.80 m tall. Every ring of a tube follows one bone, or half of two at a joint.
"""

from dataclasses import dataclass

import numpy as np

SIDES = (("left", 1.0), ("right", -1.0))
HIP = (0.095, 0.0, 0.91)
KNEE_HEIGHT, ANKLE_HEIGHT = 0.50, 0.09
SHOULDER = (0.200, 0.0, 1.41)
ELBOW_HEIGHT, WRIST_HEIGHT = 1.13, 0.88
TOE, HEEL = 0.20, 0.085  # reach of a shoe in front of and behind the ankle

_AROUND = 14  # corners of a ring

# bone: parent, head, tail; those of the limbs are added for both sides.
_TRUNK = {
    "pelvis": ("", (0.0, 0.0, 0.93), (0.0, 0.0, 1.06)),
    "chest": ("pelvis", (0.0, 0.0, 1.06), (0.0, 0.0, 1.48)),
    "head": ("chest", (0.0, 0.0, 1.52), (0.0, 0.0, 1.80)),
}


@dataclass(frozen=True)
class Bone:
    """A bone at rest: its parent's name ("" for the root), head and tail (3,) in metres."""

    parent: str
    head: tuple[float, float, float]
    tail: tuple[float, float, float]


@dataclass(frozen=True)
class Ring:
    """One cross-section of a tube.

    Attributes:
        centre: (3,) metres.
        radii: Half width across (x) and along (y, or z for a tube that lies along y).
        bones: The bones it follows, each to the same share.
        part: What covers the tube from here to the next ring, an attribute of `Kit`.
    """

    centre: tuple[float, float, float]
    radii: tuple[float, float]
    bones: tuple[str, ...]
    part: str


@dataclass(frozen=True)
class Shape:
    """A mesh and what it hangs on.

    Attributes:
        corners: (corners, 3) metres.
        faces: Corner numbers, counter-clockwise seen from outside.
        parts: What covers each face, an attribute of `Kit`.
        weights: Corner numbers and share for each bone, as (bone, numbers, share).
    """

    corners: np.ndarray
    faces: list[tuple[int, ...]]
    parts: list[str]
    weights: list[tuple[str, list[int], float]]


def skeleton() -> dict[str, Bone]:
    """All bones, parents before their children."""
    bones = {name: Bone(*rest) for name, rest in _TRUNK.items()}
    for side, sign in SIDES:
        hip, shoulder = (sign * HIP[0], *HIP[1:]), (sign * SHOULDER[0], *SHOULDER[1:])
        x, arm = hip[0], shoulder[0]
        bones |= {
            f"upper_arm.{side}": Bone("chest", shoulder, (arm, 0.0, ELBOW_HEIGHT)),
            f"forearm.{side}": Bone(
                f"upper_arm.{side}", (arm, 0.0, ELBOW_HEIGHT), (arm, 0.0, WRIST_HEIGHT)
            ),
            f"hand.{side}": Bone(f"forearm.{side}", (arm, 0.0, WRIST_HEIGHT), (arm, 0.0, 0.78)),
            f"thigh.{side}": Bone("pelvis", hip, (x, 0.0, KNEE_HEIGHT)),
            f"shin.{side}": Bone(f"thigh.{side}", (x, 0.0, KNEE_HEIGHT), (x, 0.0, ANKLE_HEIGHT)),
            f"foot.{side}": Bone(f"shin.{side}", (x, 0.0, ANKLE_HEIGHT), (x, -TOE, 0.02)),
        }
    return bones


def body_shape(skirt: bool, long_hair: bool) -> Shape:
    """The mesh of a player with a racket in the right hand."""
    build = _Builder()
    build.tube(_trunk(skirt))
    build.tube(_ellipsoid((0.0, -0.015, 1.665), (0.088, 0.108, 0.138), "head", "skin"))
    # A second skull of hair, set back and up, leaves the face free.
    build.tube(_ellipsoid((0.0, 0.012, 1.695), (0.094, 0.106, 0.122), "head", "hair"))
    if long_hair:
        build.tube(_ellipsoid((0.0, 0.125, 1.60), (0.038, 0.042, 0.125), "head", "hair"))
    for side, sign in SIDES:
        build.tube(_arm(side, sign))
        build.tube(_leg(side, sign, skirt))
        build.tube(_shoe(side, sign))
    build.racket()
    return build.shape()


def _trunk(skirt: bool) -> list[Ring]:
    hips, waist, chest = ("pelvis",), ("pelvis", "chest"), ("chest",)
    centre = 0.0, 0.0
    hem = [((*centre, 0.66), (0.225, 0.195), hips, "shorts")] if skirt else []
    rows = [
        *hem,
        ((*centre, 0.80), (0.150, 0.105), hips, "shorts"),
        ((*centre, 0.86), (0.180, 0.122), hips, "shorts"),
        ((*centre, 0.95), (0.178, 0.122), hips, "shirt"),
        ((*centre, 1.02), (0.166, 0.112), hips, "shirt"),
        ((*centre, 1.10), (0.158, 0.104), waist, "shirt"),
        ((*centre, 1.20), (0.168, 0.108), chest, "shirt"),
        ((*centre, 1.31), (0.190, 0.118), chest, "shirt"),
        ((*centre, 1.39), (0.196, 0.112), chest, "shirt"),
        ((*centre, 1.445), (0.150, 0.085), chest, "shirt"),
        ((*centre, 1.475), (0.078, 0.066), chest, "skin"),
        ((*centre, 1.50), (0.056, 0.058), chest, "skin"),
        ((*centre, 1.58), (0.052, 0.056), ("head",), "skin"),
    ]
    return [Ring(*row) for row in rows]


def _arm(side: str, sign: float) -> list[Ring]:
    upper, fore, hand = f"upper_arm.{side}", f"forearm.{side}", f"hand.{side}"
    rows = [
        (1.470, 0.020, (upper,), "shirt"),
        (1.455, 0.050, (upper,), "shirt"),
        (1.41, 0.070, (upper,), "shirt"),
        (1.33, 0.066, (upper,), "shirt"),
        (1.235, 0.068, (upper,), "shirt"),
        (1.232, 0.050, (upper,), "skin"),
        (1.17, 0.046, (upper,), "skin"),
        (1.13, 0.043, (upper, fore), "skin"),
        (1.08, 0.046, (fore,), "skin"),
        (0.98, 0.038, (fore,), "skin"),
        (0.88, 0.030, (fore, hand), "skin"),
        (0.84, 0.042, (hand,), "skin"),
        (0.79, 0.040, (hand,), "skin"),
        (0.765, 0.018, (hand,), "skin"),
    ]
    x = sign * SHOULDER[0]
    return [Ring((x, 0.0, z), (r, r), bones, part) for z, r, bones, part in rows]


def _leg(side: str, sign: float, skirt: bool) -> list[Ring]:
    thigh, shin, foot = f"thigh.{side}", f"shin.{side}", f"foot.{side}"
    trousers = "skin" if skirt else "shorts"
    wide = 0.082 if skirt else 0.100
    rows = [
        (0.95, 0.060, (thigh,), "shorts"),
        (0.90, 0.096, (thigh,), "shorts"),
        (0.80, 0.098, (thigh,), trousers),
        (0.62, wide, (thigh,), trousers),
        (0.615, 0.072, (thigh,), "skin"),
        (0.55, 0.062, (thigh,), "skin"),
        (0.50, 0.057, (thigh, shin), "skin"),
        (0.44, 0.058, (shin,), "skin"),
        (0.36, 0.060, (shin,), "skin"),
        (0.22, 0.047, (shin,), "socks"),
        (0.10, 0.043, (shin,), "socks"),
        (0.06, 0.045, (foot,), "socks"),
    ]
    x = sign * HIP[0]
    return [Ring((x, 0.0, z), (r, r), bones, part) for z, r, bones, part in rows]


def _shoe(side: str, sign: float) -> list[Ring]:
    """A tube along y, from toe to heel."""
    # y, half width, half height
    rows = [
        (-TOE, 0.022, 0.018),
        (-TOE + 0.02, 0.044, 0.030),
        (-0.12, 0.056, 0.040),
        (-0.04, 0.052, 0.055),
        (0.04, 0.048, 0.060),
        (HEEL - 0.01, 0.040, 0.052),
        (HEEL, 0.024, 0.030),
    ]
    x = sign * HIP[0]
    return [Ring((x, y, high), (wide, high), (f"foot.{side}",), "shoes") for y, wide, high in rows]


def _ellipsoid(
    centre: tuple[float, float, float], radii: tuple[float, float, float], bone: str, part: str
) -> list[Ring]:
    """Rings from the bottom up."""
    x, y, z = centre
    rings = []
    for angle in np.radians(np.linspace(-80.0, 80.0, 9)):
        level, share = z + radii[2] * np.sin(angle), np.cos(angle)
        rings.append(Ring((x, y, level), (radii[0] * share, radii[1] * share), (bone,), part))
    return rings


class _Builder:
    """Collects tubes into one mesh."""

    def __init__(self) -> None:
        self._corners: list[np.ndarray] = []
        self._faces: list[tuple[int, ...]] = []
        self._parts: list[str] = []
        self._weights: list[tuple[str, list[int], float]] = []
        self._count = 0

    def shape(self) -> Shape:
        corners = np.concatenate(self._corners)
        return Shape(corners, self._faces, self._parts, self._weights)

    def tube(self, rings: list[Ring]) -> None:
        """Skin over rings, closed at both ends."""
        along_y = rings[0].centre[1] != rings[-1].centre[1]
        upward = rings[-1].centre[2] > rings[0].centre[2]
        numbers = [self._add(_circle(ring, along_y), ring.bones) for ring in rings]
        for ring, low, high in zip(rings, numbers, numbers[1:], strict=False):
            for k in range(_AROUND):
                j = (k + 1) % _AROUND
                face = low[k], low[j], high[j], high[k]
                self._face(face, ring.part, upward and not along_y)
        self._face(tuple(numbers[0]), rings[0].part, not (upward and not along_y))
        self._face(tuple(numbers[-1]), rings[-1].part, upward and not along_y)

    def racket(self) -> None:
        """Grip, rim and strings, held on by the right hand."""
        x, bone = -SHOULDER[0], "hand.right"
        grip = [(0.82, 0.016), (0.70, 0.016), (0.60, 0.013)]
        self.tube([Ring((x, 0.0, z), (r, r), (bone,), "racket") for z, r in grip])
        turns = np.linspace(0, 2 * np.pi, 20, endpoint=False)
        rim = np.stack([x + 0.115 * np.cos(turns), 0 * turns, 0.47 + 0.140 * np.sin(turns)], -1)
        centre = np.array([x, 0.0, 0.47])
        thin = (0.0, 0.012, 0.0)
        outer = [self._add(rim + np.multiply(side, thin), (bone,)) for side in (-1, 1)]
        inner = [
            self._add(centre + 0.80 * (rim - centre) + np.multiply(side, thin), (bone,))
            for side in (-1, 1)
        ]
        count = len(turns)
        for k in range(count):
            j = (k + 1) % count
            front, back = (outer[0], inner[0]), (outer[1], inner[1])
            self._face((front[0][k], front[0][j], front[1][j], front[1][k]), "racket", True)
            self._face((back[0][k], back[0][j], back[1][j], back[1][k]), "racket", False)
            self._face((outer[0][k], outer[0][j], outer[1][j], outer[1][k]), "racket", False)
        self._face(tuple(inner[0]), "strings", True)
        self._face(tuple(inner[1]), "strings", False)

    def _add(self, corners: np.ndarray, bones: tuple[str, ...]) -> list[int]:
        numbers = list(range(self._count, self._count + len(corners)))
        self._count += len(corners)
        self._corners.append(corners)
        self._weights += [(bone, numbers, 1.0 / len(bones)) for bone in bones]
        return numbers

    def _face(self, face: tuple[int, ...], part: str, as_given: bool) -> None:
        self._faces.append(face if as_given else face[::-1])
        self._parts.append(part)


def _circle(ring: Ring, along_y: bool) -> np.ndarray:
    turns = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)
    across, along = ring.radii[0] * np.cos(turns), ring.radii[1] * np.sin(turns)
    flat = (across, 0 * turns, along) if along_y else (across, along, 0 * turns)
    return np.array(ring.centre) + np.stack(flat, axis=1)
