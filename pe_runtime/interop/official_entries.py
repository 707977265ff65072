"""Which entries of the authors' checkpoints become which of ours: the one table of names."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from torch import Tensor

from pe_runtime.config import ModelConfig, read_toml
from pe_runtime.contract.errors import CheckpointError
from pe_runtime.interop.action_weights import (
    NATIVE_ACTIONS,
    action_entries,
    convert_action_module,
    convert_discriminator,
    discriminator_entries,
)
from pe_runtime.interop.encoder_weights import (
    convert_encoder,
    convert_heading,
    encoder_entries,
    place_entries,
)
from pe_runtime.interop.field_weights import convert_field, field_entries
from pe_runtime.interop.renderer_weights import convert_renderer, renderer_entries

WORLDS = ("tennis", "minecraft")

UNUSED = ("autoencoder_model.encoder.", "camera_parameters_offsets.")
"""Entries that stage 2 keeps but never runs, and offsets that no configuration enables."""

Shapes = Mapping[str, tuple[int, ...]]


@dataclass(frozen=True)
class Part:
    """One network of theirs and what it becomes.

    Attributes:
        theirs: Prefix of its entries.
        ours: Prefix of our tensors.
        entries: Names below `theirs` and their shapes.
        convert: From those entries to tensors by name below `ours`.
    """

    theirs: str
    ours: str
    entries: Shapes
    convert: Callable[[Mapping[str, Tensor]], dict[str, Tensor]]


def official_config(world: str) -> ModelConfig:
    """The authors' model of a world ("tennis", "minecraft") in our terms."""
    return read_toml(Path(__file__).parent / f"{world}.toml", "model", ModelConfig)


def environment_parts(config: ModelConfig) -> list[Part]:
    """The environment model: fields, encoders and decoder, in the order of their objects."""
    features = sum(config.feature_renderer.features)
    parts = []
    for index, (name, each) in enumerate(_first_of_each_class(config).items()):
        parts += [
            Part(
                f"object_composer.object_models_coarse.{index}.",
                f"synthesis.fields.{name}.",
                field_entries(each, features),
                partial(convert_field, config=each, up=config.native_up),
            ),
            Part(
                f"object_encoders.{index}.",
                f"synthesis.encoders.{name}.",
                encoder_entries(each),
                partial(convert_encoder, config=each),
            ),
            Part(
                f"object_parameters_encoders.{index}.",
                f"synthesis.headings.{name}.",
                place_entries(each),
                partial(convert_heading, config=each),
            ),
        ]
    renderer = config.feature_renderer
    decoder = Part(
        "autoencoder_model.decoder.",
        "synthesis.feature_renderer.",
        renderer_entries(renderer),
        partial(convert_renderer, config=renderer),
    )
    return [*parts, decoder]


def action_parts(config: ModelConfig, world: str) -> list[Part]:
    """The playable model: an action module and a discriminator of each playable class."""
    native, parts = NATIVE_ACTIONS[world], []
    playable = {n: c for n, c in config.classes.items() if c.kind == "playable"}
    for index, (name, each) in enumerate(playable.items()):
        sizes = (each.style_features, each.pose_features)
        parts += [
            Part(
                f"object_animation_models.{index}.",
                f"actions.{name}.",
                action_entries(config.action, *sizes),
                partial(convert_action_module, config=config.action, native=native),
            ),
            Part(
                f"discriminator_models.{index}.",
                f"judges.{name}.",
                discriminator_entries(config.action, each.pose_features),
                partial(convert_discriminator, native=native),
            ),
        ]
    return parts


def convert(
    parts: list[Part], theirs: Mapping[str, Tensor], what: str, among: tuple[str, ...] = UNUSED
) -> dict[str, Tensor]:
    """Our tensors of all parts, float32; all that does not fit is named at once.

    Args:
        parts: The table.
        theirs: All entries.
        what: Names the file in errors.
        among: Prefixes of entries that are known and left alone.

    Raises:
        CheckpointError: Entries are missing, unexpected or of another shape.
    """
    wanted = {part.theirs + name: shape for part in parts for name, shape in part.entries.items()}
    unexpected = [n for n in theirs if n not in wanted and not n.startswith(among)]
    misshapen = [
        f"{name} {tuple(theirs[name].shape)} instead of {shape}"
        for name, shape in wanted.items()
        if name in theirs and tuple(theirs[name].shape) != tuple(shape)
    ]
    found = (
        ("missing", [name for name in wanted if name not in theirs]),
        ("unexpected", unexpected),
        ("misshapen", misshapen),
    )
    problems = [f"{kind} ({len(names)}): {', '.join(names)}" for kind, names in found if names]
    if problems:
        raise CheckpointError(f"{what} does not hold the published model; " + "; ".join(problems))
    ours = {}
    for part in parts:
        own = {name: theirs[part.theirs + name] for name in part.entries}
        ours |= {part.ours + name: t.float().contiguous() for name, t in part.convert(own).items()}
    return ours


def _first_of_each_class(config: ModelConfig) -> dict[str, object]:
    """Classes in the order in which objects first use them: models shared by several come once."""
    names = dict.fromkeys(each.class_name for each in config.objects)
    return {name: config.classes[name] for name in names}
