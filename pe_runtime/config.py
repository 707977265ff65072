"""Every knob of model, training and rendering as frozen dataclasses, read from TOML.

A key that no dataclass knows is an error that names the nearest known key; a number that makes no
sense is an error that names the key. Widths and depths are all here; nothing is derived elsewhere.
"""

import dataclasses
import difflib
import math
import tomllib
import types
import typing
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pe_runtime.contract.errors import ConfigError

Triple = tuple[float, float, float]
KINDS = ("playable", "static", "sky")
CROPS = ("box", "volume", "frame")


def _demand(holds: bool, expected: str) -> None:
    if not holds:
        raise ConfigError(f"expected {expected}")


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
    density_scale: float = 10.0
    """Optical thickness per metre of a unit density output."""

    def __post_init__(self) -> None:
        _demand(min(self.width, self.depth, self.head_width) >= 1, "field: widths and depth >= 1")
        _demand(self.octaves >= 0, "field: octaves >= 0")
        _demand(0 <= self.skip < self.depth, "field: skip from 0 (none) to depth - 1")


@dataclass(frozen=True)
class BendingConfig:
    """Ray bending B: position and pose -> displacement towards the canonical space."""

    width: int = 64
    depth: int = 3
    octaves: int = 4
    base_frequency: float = math.pi / 2
    output_scale: float = 0.01
    """Standard deviation of the output layer's initial weights (reference: small, never zero)."""


@dataclass(frozen=True)
class EncoderConfig:
    """Encoder E of one object class: crop -> style and pose."""

    crop: str = "volume"
    """What is cut out: the "box", the projected "volume" at the box's position, or the "frame"."""
    height: int = 48
    width: int = 48
    channels: tuple[int, ...] = (16, 32, 64, 64)
    hidden: int = 128
    shared_trunk: bool = False
    """One trunk for style and pose instead of two; collapses the pose on small budgets."""

    def __post_init__(self) -> None:
        _demand(self.crop in CROPS, f"encoder: crop one of {', '.join(CROPS)}, not {self.crop!r}")
        _demand(min(self.height, self.width, self.hidden) >= 1, "encoder: sizes >= 1")
        groups = self.channels and all(c > 0 and c % 4 == 0 for c in self.channels)
        _demand(bool(groups), "encoder: channels in multiples of 4 (its normalisation groups)")


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
    opaque: bool = False
    """Density is infinite inside the volume instead of learnt (ground, walls, sky)."""
    style_features: int = 16
    pose_features: int = 0
    foot_offset: float = 0.0
    """Metres from a box's foot point, away from the camera, to the object's middle."""
    field: FieldConfig = FieldConfig()
    bending: BendingConfig | None = None
    encoder: EncoderConfig = EncoderConfig()

    def __post_init__(self) -> None:
        _demand(self.kind in KINDS, f"class: kind one of {', '.join(KINDS)}, not {self.kind!r}")
        ordered = all(a < b for a, b in zip(self.low, self.high, strict=True))
        _demand(ordered, f"class: low below high on every axis, not {self.low} and {self.high}")
        _demand(self.samples >= 1, f"class: samples >= 1, not {self.samples}")
        _demand(bool(self.axes) and set(self.axes) <= {0, 1, 2}, "class: axes out of 0, 1, 2")
        _demand(self.style_features >= 1, "class: style_features >= 1")
        bends = self.bending is not None
        _demand(self.pose_features >= int(bends), "class: pose_features >= 1 where rays are bent")


@dataclass(frozen=True)
class ObjectConfig:
    """One object of the environment: its class and, when static, its place."""

    name: str
    class_name: str
    position: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class FeatureRendererConfig:
    """Feature renderer F: feature maps at several strides -> image."""

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
        levels = {len(self.strides), len(self.features), len(self.widths)}
        _demand(
            len(levels) == 1 and self.strides != (),
            "feature_renderer: one entry a map in each list",
        )
        doubles = all(2 * a == b for a, b in zip(self.strides, self.strides[1:], strict=False))
        _demand(doubles, f"feature_renderer: each stride twice the one before, not {self.strides}")
        _demand(
            self.strides[0] == 2 ** len(self.output_widths),
            "feature_renderer: as many output_widths as doublings from the finest map to the image",
        )
        _demand(self.features[0] >= 3, "feature_renderer: 3 features or more in the finest map")


@dataclass(frozen=True)
class ActionConfig:
    """Action network A, dynamics network R and discriminator D of one playable class."""

    actions: int = 7
    variability: int = 4
    hidden: int = 128
    dynamics_width: int = 192
    dynamics_layers: int = 1
    discriminator_width: int = 64
    position_scale: Triple = (4.0, 4.0, 2.0)
    movement_scale: float = 0.3
    movement_frame: str = "camera"
    predict_style: bool = False
    window: int = 3


@dataclass(frozen=True)
class ModelConfig:
    """One playable environment: its objects, their classes, and the networks around them."""

    name: str = "duel"
    width: int = 256
    height: int = 144
    steps_per_second: float = 5.0
    near: float = 0.05
    """Planar depth in metres before which nothing is drawn."""
    classes: Mapping[str, ObjectClassConfig] = field(default_factory=dict)
    objects: tuple[ObjectConfig, ...] = ()
    feature_renderer: FeatureRendererConfig = FeatureRendererConfig()
    action: ActionConfig = ActionConfig()

    def __post_init__(self) -> None:
        _demand(min(self.width, self.height) >= 1, "model: width and height >= 1")
        _demand(self.steps_per_second > 0, "model: steps_per_second above 0")
        names = [each.name for each in self.objects]
        _demand(len(set(names)) == len(names), f"model: object names that differ, not {names}")
        for each in self.objects:
            known = ", ".join(self.classes)
            found = each.class_name in self.classes
            _demand(found, f"object {each.name!r}: a class out of {known}, not {each.class_name!r}")

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


@dataclass(frozen=True)
class SynthesisConfig:
    """Training of encoder, fields and feature renderer (paper, Sec. 3.3)."""

    steps: int = 8000
    sequences: int = 4
    frames: int = 2
    patch_height: int = 80
    patch_width: int = 64
    player_patches: float = 0.7
    """Share of patches centred on a playable object; the rest fall anywhere."""
    learning_rate: float = 2e-3
    renderer_learning_rate: float = 1e-3
    warmup: int = 100
    clip: float = 1.0
    perceptual_weight: float = 0.3
    gradient_weight: float = 0.03
    permute_style: bool = True
    density_noise: float = 0.0
    bfloat16: bool = True
    seed: int = 0
    evaluate_every: int = 500
    checkpoint_every: int = 250

    def __post_init__(self) -> None:
        counts = (self.sequences, self.frames, self.checkpoint_every)
        _demand(min(counts) >= 1, "synthesis: sequences, frames, checkpoint_every >= 1")
        smallest = min(self.patch_height, self.patch_width)
        _demand(smallest >= 16, f"synthesis: patches of 16 pixels or more, not {smallest}")


@dataclass(frozen=True)
class Quality:
    """What one render quality leaves out, beyond what can be skipped without changing a pixel."""

    weight_threshold: float = 0.0
    """Samples with less weight than this get no features."""
    sample_share: float = 1.0
    """Share of the class's samples that are drawn per ray."""
    bfloat16: bool = False


QUALITIES: Mapping[str, Quality] = types.MappingProxyType(
    {
        "exact": Quality(),
        "balanced": Quality(weight_threshold=1e-4),
        "draft": Quality(weight_threshold=1e-3, sample_share=0.5, bfloat16=True),
    }
)


def read_toml(path: str | Path, section: str, kind: type) -> Any:  # noqa: ANN401
    """Read one section of a TOML file into a configuration dataclass.

    Args:
        path: TOML file.
        section: Name of the top-level table; absent means all defaults.
        kind: Dataclass to build.

    Raises:
        ConfigError: The file cannot be read, a key is unknown, or a value has the wrong type.
    """
    try:
        document = tomllib.loads(Path(path).read_text())
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as problem:
        raise ConfigError(f"cannot read the configuration {path}: {problem}") from problem
    return from_dict(kind, document.get(section, {}), section)


def from_dict(kind: type, values: object, where: str = "config") -> Any:  # noqa: ANN401
    """Build a configuration dataclass from plain values (parsed TOML or JSON).

    Raises:
        ConfigError: A key is unknown (the nearest known one is named), missing or of a wrong type.
    """
    if not isinstance(values, Mapping):
        raise ConfigError(f"{where}: expected a table of settings, found {values!r}")
    known = {each.name: each for each in dataclasses.fields(kind)}
    hints = typing.get_type_hints(kind)
    for key in values:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else f"; known: {', '.join(known)}"
            raise ConfigError(f"{where}: unknown key {key!r}{hint}")
    missing = [name for name, each in known.items() if _required(each) and name not in values]
    if missing:
        raise ConfigError(f"{where}: missing key {missing[0]!r}")
    built = {key: _convert(hints[key], value, f"{where}.{key}") for key, value in values.items()}
    return kind(**built)


def as_dict(config: Any) -> dict[str, Any]:  # noqa: ANN401
    """The configuration as JSON-able values; `from_dict` reads it back."""
    return dataclasses.asdict(config)


def _required(each: dataclasses.Field) -> bool:
    no_default = each.default is dataclasses.MISSING
    return no_default and each.default_factory is dataclasses.MISSING


def _convert(hint: Any, value: Any, where: str) -> Any:  # noqa: ANN401
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is types.UnionType:
        return None if value is None else _convert(arguments[0], value, where)
    if dataclasses.is_dataclass(hint):
        return from_dict(hint, value, where)
    if origin is tuple:
        return _convert_tuple(arguments, value, where)
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if origin is not None:
        return _convert_table(arguments[1], value, where)
    if not isinstance(value, hint) or (hint is int and isinstance(value, bool)):
        raise ConfigError(f"{where}: expected {hint.__name__}, found {value!r}")
    if hint is float and not math.isfinite(value):
        raise ConfigError(f"{where}: expected a finite number, found {value!r}")
    return value


def _convert_table(hint: Any, value: Any, where: str) -> dict[str, Any]:  # noqa: ANN401
    if not isinstance(value, Mapping):
        raise ConfigError(f"{where}: expected a table, found {value!r}")
    return {key: _convert(hint, each, f"{where}.{key}") for key, each in value.items()}


def _convert_tuple(arguments: tuple[Any, ...], value: Any, where: str) -> tuple:  # noqa: ANN401
    if not isinstance(value, list | tuple):
        raise ConfigError(f"{where}: expected a list, found {value!r}")
    if arguments[-1] is Ellipsis:
        return tuple(_convert(arguments[0], v, f"{where}[{i}]") for i, v in enumerate(value))
    if len(value) != len(arguments):
        raise ConfigError(f"{where}: expected {len(arguments)} values, found {len(value)}")
    return tuple(_convert(arguments[i], v, f"{where}[{i}]") for i, v in enumerate(value))
