"""Objects of an environment: their volumes, fields, bending and encoders."""

import math
from dataclasses import dataclass

from pe_runtime.config.checks import demand, demand_one_of

Triple = tuple[float, float, float]
KINDS = ("playable", "static", "sky")
DENSITIES = ("softplus", "relu")
ENCODER_DESIGNS = ("compact", "residual", "attentive")
CROPS = ("box", "volume", "visible-volume", "frame")
RESAMPLINGS = ("bilinear", "max")
STYLE_INPUTS = ("modulation", "concatenation")
VIEWS = ("direction", "camera", "none")


@dataclass(frozen=True)
class FieldConfig:
    """Feature field V: trunk -> density, and a style-modulated feature branch."""

    width: int = 64
    depth: int = 4
    skip: int = 0
    """Trunk layer before which the encoded position is concatenated again; 0 for none."""
    octaves: int = 6
    base_frequency: float = math.pi / 2
    """Angular frequency of the first octave, per half box size."""
    head_width: int = 64
    branch_width: int = 0
    """Width of the feature branch's second layer; 0 for that of its first, `head_width`."""
    density: str = "softplus"
    """How raw outputs become densities: "softplus" of (raw - 2.5), or "relu"."""
    density_scale: float = 10.0
    """Optical thickness per metre of a unit density output."""

    def __post_init__(self) -> None:
        demand(min(self.width, self.depth, self.head_width) >= 1, "field: widths and depth >= 1")
        demand(self.branch_width >= 0, "field: branch_width >= 0")
        demand(self.octaves >= 0, "field: octaves >= 0")
        demand(0 <= self.skip < self.depth, "field: skip from 0 (none) to depth - 1")
        demand_one_of(self.density, DENSITIES, "field: density")


@dataclass(frozen=True)
class BendingConfig:
    """Ray bending B: position and pose -> displacement towards the canonical space."""

    width: int = 64
    depth: int = 3
    skip: int = 0
    """Layer before which encoded position and pose are concatenated again; 0 for none."""
    octaves: int = 4
    base_frequency: float = math.pi / 2
    output_scale: float = 0.01
    """Standard deviation of the output layer's initial weights (reference: small, never zero)."""

    def __post_init__(self) -> None:
        demand(min(self.width, self.depth) >= 1, "bending: width and depth >= 1")
        demand(0 <= self.skip < self.depth, "bending: skip from 0 (none) to depth - 1")


@dataclass(frozen=True)
class EncoderConfig:
    """Encoder E of one object class: crop -> style and pose."""

    design: str = "compact"
    """"compact" (ours), or the two of the paper's authors: "residual" (v5, a ResNet for static
    objects and headings) and "attentive" (v4, small, with a learnt mask, for players)."""
    crop: str = "volume"
    """What is cut out: the "box"; the projected "volume" at the box's position, which must lie in
    front of the camera as a whole; its "visible-volume", clipped to the picture; or the "frame"."""
    resampling: str = "bilinear"
    """How the region becomes a crop: "bilinear", or "max" of the pixels in each cell."""
    widen: tuple[float, float] = (0.0, 0.0)
    """Shares of a box's width added on either side, and of its height added on top."""
    view: str = "direction"
    """What E learns of the view: "direction" to the object and the region's place; the "camera"'s
    Euler angles and position in the native world; or "none"."""
    angle_middles: Triple = (0.0, 0.0, 0.0)
    """Radians in the middle of the whole turn within which each angle of the "camera" is told: an
    orientation says its angles only up to whole turns."""
    height: int = 48
    width: int = 48
    channels: tuple[int, ...] = (16, 32, 64, 64)
    hidden: int = 128
    shared_trunk: bool = False
    """One trunk for style and pose instead of two; collapses the pose on small budgets."""

    def __post_init__(self) -> None:
        demand_one_of(self.design, ENCODER_DESIGNS, "encoder: design")
        demand_one_of(self.crop, CROPS, "encoder: crop")
        demand_one_of(self.resampling, RESAMPLINGS, "encoder: resampling")
        demand_one_of(self.view, VIEWS, "encoder: view")
        demand(min(self.widen) >= 0, "encoder: widen >= 0")
        demand(min(self.height, self.width, self.hidden) >= 1, "encoder: sizes >= 1")
        positive = self.channels and min(self.channels) >= 1
        demand(bool(positive), "encoder: one width or more in channels, all >= 1")
        if self.design == "compact":
            groups = all(c % 4 == 0 for c in self.channels)
            demand(groups, "encoder: channels in multiples of 4 (its normalisation groups)")
        else:
            halvings = len(self.channels) + (self.design == "residual")
            fits = min(self.height, self.width) >= 2**halvings
            demand(fits, f"encoder: height and width >= {2**halvings}, which it halves to one cell")


@dataclass(frozen=True)
class ObjectClassConfig:
    """What the objects of one class share: volume, field, bending and encoder."""

    kind: str = "static"
    """"playable", "static" or "sky"."""
    low: Triple = (-1.0, -1.0, 0.0)
    high: Triple = (1.0, 1.0, 2.0)
    axes: tuple[int, ...] = (0, 1, 2)
    """Object coordinates that enter V; a plane needs two."""
    samples: int = 16
    depth_range: tuple[float, float] | None = None
    """Planar depths in metres between which the samples of "release-2022" lie; the first is where a
    sky stands. None: from the model's `near` to infinity."""
    opaque: bool = False
    """Density is infinite inside the volume instead of learnt (ground, walls, sky)."""
    sees_origin: bool = False
    """A sky's V is also told where the camera stands, in box sizes."""
    style_features: int = 16
    """Length of w; 0 for an object that always looks the same."""
    style_input: str = "modulation"
    """How w enters the feature branch: "modulation" of its layers, or "concatenation" with what
    enters them (the paper's ablation)."""
    pose_features: int = 0
    foot_offset: float = 0.0
    """Metres from a box's foot point, away from the camera, to the object's middle."""
    lift: float = 0.0
    """Metres above the ground at which playable objects stand."""
    field: FieldConfig = FieldConfig()
    bending: BendingConfig | None = None
    encoder: EncoderConfig = EncoderConfig()
    heading: EncoderConfig | None = None
    """Encoder of the heading (yaw); None where objects keep the world's axes."""

    def __post_init__(self) -> None:
        demand_one_of(self.kind, KINDS, "class: kind")
        ordered = all(a < b for a, b in zip(self.low, self.high, strict=True))
        demand(ordered, f"class: low below high on every axis, not {self.low} and {self.high}")
        demand(self.samples >= 1, f"class: samples >= 1, not {self.samples}")
        demand(bool(self.axes) and set(self.axes) <= {0, 1, 2}, "class: axes out of 0, 1, 2")
        near, far = self.depth_range or (0.0, 1.0)
        demand(0 <= near < far, f"class: depth_range from near to far, not {self.depth_range}")
        demand(self.style_features >= 0, "class: style_features >= 0")
        demand_one_of(self.style_input, STYLE_INPUTS, "class: style_input")
        bends = self.bending is not None
        demand(self.pose_features >= int(bends), "class: pose_features >= 1 where rays are bent")
        if self.heading is not None:
            demand(self.kind == "playable", "class: heading of playable objects only")
            known = self.heading.design != "compact"
            demand(known, 'class: heading of design "residual" or "attentive"')


@dataclass(frozen=True)
class ObjectConfig:
    """One object of the environment: its class and, when static, its place."""

    name: str
    class_name: str
    position: Triple = (0.0, 0.0, 0.0)
