"""The environment as a whole: its objects, feature renderer and action module."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from pe_runtime.config.checks import demand, demand_one_of
from pe_runtime.config.objects import ObjectClassConfig, ObjectConfig, Triple
from pe_runtime.contract.errors import ConfigError

RENDERER_DESIGNS = ("light", "paper", "direct")
ACTION_DESIGNS = ("transition", "state")
MOVEMENT_FRAMES = ("camera", "world", "object")
DISCRIMINATORS = ("movements", "states")
QUADRATURES = ("interval", "release-2022")


@dataclass(frozen=True)
class FeatureRendererConfig:
    """Feature renderer F: feature maps at several strides -> image."""

    design: str = "light"
    """"light" (ours), or "paper": the decoder of the paper's authors, with more and wider blocks
    and a convolution after every doubling; or "direct": no ConvNet, one ray per pixel has its
    colour."""
    activated_blocks: bool = False
    """A ReLU after every residual block of the "paper" design (v7; without: v6)."""
    strides: tuple[int, ...] = (2, 4)
    """Pixels per ray of each feature map, finest first; each twice the one before."""
    features: tuple[int, ...] = (24, 32)
    """Channels of each feature map."""
    widths: tuple[int, ...] = (48, 64)
    """Channels of the blocks that work at each stride."""
    output_widths: tuple[int, ...] = (24,)
    """Channels after each further doubling up to image resolution."""
    blocks: int = 1

    def __post_init__(self) -> None:
        demand_one_of(self.design, RENDERER_DESIGNS, "feature_renderer: design")
        levels = {len(self.strides), len(self.features), len(self.widths)}
        demand(
            len(levels) == 1 and self.strides != (),
            "feature_renderer: one entry a map in each list",
        )
        doubles = all(2 * a == b for a, b in zip(self.strides, self.strides[1:], strict=False))
        demand(doubles, f"feature_renderer: each stride twice the one before, not {self.strides}")
        demand(
            self.strides[0] == 2 ** len(self.output_widths),
            "feature_renderer: as many output_widths as doublings from the finest map to the image",
        )
        demand(self.features[0] >= 3, "feature_renderer: 3 features or more in the finest map")
        plain = self.strides == (1,) and self.features == (3,)
        demand(
            plain or self.design != "direct",
            'feature_renderer: strides [1], features [3], no output_widths for a "direct" one',
        )


@dataclass(frozen=True)
class ActionConfig:
    """Action network A, dynamics network R and discriminator D of one playable class."""

    design: str = "transition"
    """How A works: from each "transition" with its neighbours (ours), or from each "state" on its
    own, whose embeddings' differences are the action directions (the paper's authors)."""
    actions: int = 7
    variability: int = 4
    hidden: int = 128
    dynamics_width: int = 192
    dynamics_layers: int = 1
    discriminator: str = "movements"
    """What D judges: "movements" and poses (ours), or positions and poses beside the actions that
    A found in them, "states" (the paper's authors)."""
    discriminator_width: int = 64
    discriminator_scale: Triple = (1.0, 1.0, 1.0)
    """Metres that count as 1 where positions enter a D of "states"."""
    position_scale: Triple = (4.0, 4.0, 2.0)
    """Metres that count as 1 where positions enter R and a "state" A."""
    bounded_positions: bool = True
    """Positions enter R through tanh, so that far away says "far" and no more."""
    movement_scale: float = 0.3
    movement_frame: str = "camera"
    """Whose right and forward R's movements mean: the "camera"'s, the "object"'s own heading, or
    the "world"'s x and y."""
    sees_heading: bool = False
    """The heading (sine, cosine) enters R and a "state" A."""
    predict_heading: bool = False
    """R also turns objects."""
    predict_style: bool = False
    window: int = 3
    """Transitions that a "transition" A reads at once, the middle one being the one in question."""

    def __post_init__(self) -> None:
        demand_one_of(self.design, ACTION_DESIGNS, "action: design")
        demand_one_of(self.movement_frame, MOVEMENT_FRAMES, "action: movement_frame")
        demand_one_of(self.discriminator, DISCRIMINATORS, "action: discriminator")
        sees = self.sees_heading or not self.predict_heading
        demand(sees, "action: sees_heading where predict_heading")


@dataclass(frozen=True)
class ModelConfig:
    """One playable environment: its objects, their classes, and the networks around them."""

    name: str = "duel"
    width: int = 256
    height: int = 144
    steps_per_second: float = 5.0
    near: float = 0.05
    """Planar depth in metres before which nothing is drawn."""
    quadrature: str = "interval"
    """How rays are sampled and summed. "interval": one sample per equal interval of an object's
    passage, thickness over that interval. "release-2022": what the checkpoints of the paper's
    authors were trained with; see `rendering/release_2022.py` for its seven peculiarities."""
    carve_overlaps: bool = False
    """Under "release-2022", static samples within a player's passage are left out."""
    native_up: str = "z"
    """Up axis of the world that the networks were trained in, "z" or "y". States and cameras are
    Z-up always; this says in which axes encoders are told camera angles."""
    classes: Mapping[str, ObjectClassConfig] = field(default_factory=dict)
    objects: tuple[ObjectConfig, ...] = ()
    feature_renderer: FeatureRendererConfig = FeatureRendererConfig()
    action: ActionConfig = ActionConfig()

    def __post_init__(self) -> None:
        demand(min(self.width, self.height) >= 1, "model: width and height >= 1")
        demand(self.steps_per_second > 0, "model: steps_per_second above 0")
        demand_one_of(self.quadrature, QUADRATURES, "model: quadrature")
        demand_one_of(self.native_up, ("z", "y"), "model: native_up")
        hard = [name for name, each in self.classes.items() if each.opaque and each.kind != "sky"]
        ours = self.quadrature == "interval" or not hard
        demand(
            ours, f"model: no opaque class under {self.quadrature!r}, which has none, not {hard}"
        )
        names = [each.name for each in self.objects]
        demand(len(set(names)) == len(names), f"model: object names that differ, not {names}")
        for each in self.objects:
            known = ", ".join(self.classes)
            found = each.class_name in self.classes
            demand(found, f"object {each.name!r}: a class out of {known}, not {each.class_name!r}")

    @property
    def playable_names(self) -> tuple[str, ...]:
        """Names of the objects that actions move, in order."""
        return tuple(o.name for o in self.objects if self.classes[o.class_name].kind == "playable")

    def class_of(self, name: str) -> ObjectClassConfig:
        """The class of the named object.

        Raises:
            ConfigError: The environment has no such object.
        """
        for each in self.objects:
            if each.name == name:
                return self.classes[each.class_name]
        known = ", ".join(o.name for o in self.objects)
        raise ConfigError(f"no object {name!r} in this environment; it has: {known}")
