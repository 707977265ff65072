"""Encoders of the authors' checkpoints: what their entries are called, and ours from them.

    theirs                            ours
    conv1, bn1                        trunk.stem
    initial_backbone.0                trunk.attention     ("attentive")
    initial_backbone.{0,1}            trunk.blocks.{0,1}  ("residual")
    final_backbone.N                  trunk.blocks.N, or N + 2 ("residual")
      conv1, bn1                        first
      conv2, bn2                        second
      downsample.0, downsample.2        shortcut
    style_head                        style
    deformation_head                  pose; dropped for objects without one
    rotation_head                     direction

Batch normalisations are folded into the convolutions before them. The average pooling that stands
between the two commutes with them.
"""

from collections.abc import Mapping

from torch import Tensor

from pe_runtime.config import EncoderConfig, ObjectClassConfig
from pe_runtime.interop.folding import batch_statistics, folded_linear
from pe_runtime.perception.views import view_size

DEFORMATION = 32
"""Outputs of the deformation head, which objects without a pose have as well."""

Shapes = dict[str, tuple[int, ...]]


def encoder_entries(config: ObjectClassConfig) -> Shapes:
    """Their names and shapes of one object encoder, below `object_encoders.N.`.

    Args:
        config: The class in our terms, with a "residual" or "attentive" encoder.
    """
    entries = _trunk_entries(config.encoder)
    features = config.encoder.channels[-1]
    entries |= _linear_entries("style_head", features, config.style_features)
    deformation = config.pose_features or DEFORMATION
    return entries | _linear_entries("deformation_head", features, deformation)


def place_entries(config: ObjectClassConfig) -> Shapes:
    """Their names and shapes of one class's places, below `object_parameters_encoders.N.`.

    A yaw encoder where the class has headings. Elsewhere buffers of ranges, none of which we need.
    """
    if config.heading is None:
        return {"translation_range": (1, 3, 2), "rotation_range": (1, 3, 2)}
    head = _linear_entries("rotation_head", config.heading.channels[-1], 2)
    return _trunk_entries(config.heading) | head


def convert_encoder(theirs: Mapping[str, Tensor], config: ObjectClassConfig) -> dict[str, Tensor]:
    """Weights of one `ResidualEncoder` from theirs.

    Args:
        theirs: The entries of `encoder_entries`.
        config: The class in our terms.

    Returns:
        Our names and tensors, float64; rounding to float32 is left to the caller.
    """
    ours = _convert_trunk(theirs, config.encoder)
    ours |= _convert_linear(theirs, "style_head", "style")
    if config.pose_features:
        ours |= _convert_linear(theirs, "deformation_head", "pose")
    return ours


def convert_heading(theirs: Mapping[str, Tensor], config: ObjectClassConfig) -> dict[str, Tensor]:
    """Weights of one `HeadingEncoder` from theirs; none for a class without headings.

    Args:
        theirs: The entries of `place_entries`.
        config: The class in our terms.

    Returns:
        Our names and tensors, float64.
    """
    if config.heading is None:
        return {}
    ours = _convert_trunk(theirs, config.heading)
    return ours | _convert_linear(theirs, "rotation_head", "direction")


def _blocks(encoder: EncoderConfig) -> list[tuple[str, str, int, int, bool]]:
    """Their name, ours, the channels in and out and whether there is a shortcut, block by block."""
    first, blocks = encoder.channels[0], []
    if encoder.design == "attentive":
        blocks.append(("initial_backbone.0", "trunk.attention", first, first + 1, True))
        widths, initial = encoder.channels[1:], 0
    else:
        widths, initial = encoder.channels, 2
    narrow = first
    for index, wide in enumerate(each for each in widths for _ in range(2)):
        final = index - initial
        theirs = f"initial_backbone.{index}" if final < 0 else f"final_backbone.{final}"
        shrinks = index % 2 == 0
        blocks.append((theirs, f"trunk.blocks.{index}", narrow, wide, shrinks))
        narrow = wide
    return blocks


def _layers(encoder: EncoderConfig) -> list[tuple[str, str, str, tuple[int, int, int]]]:
    """Convolutions: theirs, its normalisation, ours, and (out, in, size of the kernel)."""
    size = 7 if encoder.design == "residual" else 3
    stem = (encoder.channels[0], 3 + view_size(encoder), size)
    layers = [("conv1", "bn1", "trunk.stem", stem)]
    for theirs, ours, narrow, wide, has_shortcut in _blocks(encoder):
        layers += [
            (f"{theirs}.conv1", f"{theirs}.bn1", f"{ours}.first", (wide, narrow, 3)),
            (f"{theirs}.conv2", f"{theirs}.bn2", f"{ours}.second", (wide, wide, 3)),
        ]
        if has_shortcut:
            pair = f"{theirs}.downsample.0", f"{theirs}.downsample.2"
            layers.append((*pair, f"{ours}.shortcut", (wide, narrow, 1)))
    return layers


def _trunk_entries(encoder: EncoderConfig) -> Shapes:
    entries: Shapes = {}
    for convolution, normalisation, _, (wide, narrow, size) in _layers(encoder):
        entries[f"{convolution}.weight"] = (wide, narrow, size, size)
        entries |= batch_statistics(normalisation, wide, affine=True)
    return entries


def _convert_trunk(theirs: Mapping[str, Tensor], encoder: EncoderConfig) -> dict[str, Tensor]:
    ours = {}
    for convolution, normalisation, name, _ in _layers(encoder):
        kernel = theirs[f"{convolution}.weight"]
        weight, bias = folded_linear(kernel, None, theirs, normalisation)
        ours |= {f"{name}.weight": weight, f"{name}.bias": bias}
    return ours


def _linear_entries(name: str, narrow: int, wide: int) -> Shapes:
    return {f"{name}.weight": (wide, narrow), f"{name}.bias": (wide,)}


def _convert_linear(theirs: Mapping[str, Tensor], name: str, ours: str) -> dict[str, Tensor]:
    return {f"{ours}.{part}": theirs[f"{name}.{part}"].double() for part in ("weight", "bias")}
