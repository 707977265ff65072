"""The rows of the paper's ablation tables, as changes of a model's and a training's configuration.

A row is named after the last thing that it has; ticks say all that it has. Every row is derived
from the same full configuration, so a difference between two rows is a difference of one part.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from pe_runtime.config.checks import demand_one_of
from pe_runtime.config.model import FeatureRendererConfig, ModelConfig
from pe_runtime.config.objects import EncoderConfig, ObjectClassConfig, ObjectConfig
from pe_runtime.config.runs import SynthesisConfig

SCENE_SAMPLES = 32
"""Samples per ray of the one volume of row "plain"."""


@dataclass(frozen=True)
class SynthesisRow:
    """What a row of the paper's synthesis ablation has ("~": in a simpler form).

    Attributes:
        letter: Of the paper.
        multi: Several objects, "" for one volume that is everything.
        pose: Deformation by pi.
        style: "x" by modulation, "~" by concatenation.
        renderer: F, "~" from one coarse map of the whole frame.
    """

    letter: str
    multi: str = ""
    pose: str = ""
    style: str = ""
    renderer: str = ""


SYNTHESIS_ROWS: Mapping[str, SynthesisRow] = {
    "plain": SynthesisRow("a"),
    "multi": SynthesisRow("b", "x"),
    "multi-pose": SynthesisRow("c", "x", "x"),
    "concatenation": SynthesisRow("d", "x", "x", "~"),
    "modulation": SynthesisRow("e", "x", "x", "x"),
    "single-resolution": SynthesisRow("f", "x", "x", "x", "~"),
    "full": SynthesisRow("Full", "x", "x", "x", "x"),
}


@dataclass(frozen=True)
class ActionRow:
    """Which parts a row of the paper's action ablation has.

    Attributes:
        relative: R's movements are relative to the camera, else to the world.
        discriminator: D.
        movement_loss: L_Delta.
        action_loss: L_act.
    """

    relative: bool = True
    discriminator: bool = True
    movement_loss: bool = True
    action_loss: bool = True


ACTION_ROWS: Mapping[str, ActionRow] = {
    "A": ActionRow(False, False, False, True),
    "B": ActionRow(True, False, False, True),
    "C": ActionRow(True, False, True, True),
    "D": ActionRow(True, True, False, True),
    "E": ActionRow(True, True, True, False),
    "full": ActionRow(),
}


def ablated_synthesis(
    model: ModelConfig, training: SynthesisConfig, row: str
) -> tuple[ModelConfig, SynthesisConfig]:
    """The full configurations without what a row lacks.

    Args:
        model: The full model.
        training: Its synthesis training.
        row: One of `SYNTHESIS_ROWS`.

    Raises:
        ConfigError: There is no such row.
    """
    demand_one_of(row, tuple(SYNTHESIS_ROWS), "ablation: row")
    has = SYNTHESIS_ROWS[row]
    if not has.multi:
        model = _one_volume(model)
    if not has.pose:
        model = _each_class(model, lambda each: replace(each, bending=None, pose_features=0))
    if not has.style:
        model = _each_class(model, lambda each: replace(each, style_features=0))
    if has.style == "~":
        model = _each_class(model, lambda each: replace(each, style_input="concatenation"))
    if not has.renderer:
        model = replace(model, feature_renderer=_no_renderer())
        # A ray per pixel: patches of a quarter of the pixels cost four times the rays still.
        height, width = training.patch_height // 2, training.patch_width // 2
        training = replace(training, patch_height=max(16, height), patch_width=max(16, width))
    if has.renderer == "~":
        model = replace(model, feature_renderer=_one_map(model.feature_renderer))
        training = replace(training, patch_height=model.height, patch_width=model.width)
    return model, training


def _each_class(
    model: ModelConfig, change: Callable[[ObjectClassConfig], ObjectClassConfig]
) -> ModelConfig:
    return replace(model, classes={name: change(each) for name, each in model.classes.items()})


def _one_volume(model: ModelConfig) -> ModelConfig:
    """Everything in one static volume that holds all objects of the full model."""
    bounded = [each for each in model.objects if model.class_of(each.name).kind != "sky"]
    corners = []
    for each in bounded:
        kind = model.classes[each.class_name]
        # Where a player stands is not known here; it stands on something static.
        place = each.position if kind.kind == "static" else (0.0, 0.0, 0.0)
        corners += [
            tuple(p + c for p, c in zip(place, corner, strict=True))
            for corner in (kind.low, kind.high)
        ]
    low = tuple(min(each[axis] for each in corners) for axis in range(3))
    high = tuple(max(each[axis] for each in corners) for axis in range(3))
    # The sky is the far side of the volume: room for it above everything.
    high = (high[0], high[1], low[2] + 2.5 * (high[2] - low[2]))
    largest = max(
        (model.classes[each.class_name].field for each in bounded), key=lambda each: each.width
    )
    scene = ObjectClassConfig(
        low=low,
        high=high,
        samples=SCENE_SAMPLES,
        style_features=0,
        field=replace(largest, octaves=9, density_scale=1.0),
        encoder=EncoderConfig(crop="frame"),
    )
    return replace(model, classes={"scene": scene}, objects=(ObjectConfig("scene", "scene"),))


def _no_renderer() -> FeatureRendererConfig:
    return FeatureRendererConfig(
        "direct", strides=(1,), features=(3,), widths=(1,), output_widths=()
    )


def _one_map(full: FeatureRendererConfig) -> FeatureRendererConfig:
    """The coarsest map only, with all channels, doubled up to the picture."""
    coarsest = full.strides[-1]
    doublings = coarsest.bit_length() - 1
    return replace(
        full,
        strides=(coarsest,),
        features=(sum(full.features),),
        widths=(full.widths[-1],),
        output_widths=(*full.widths[:-1], *full.output_widths)[-doublings:],
    )
