"""The authors' neural fields in ours: V, its style modulation, and ray bending B.

Nothing is approximated. What they compute and our modules do not is folded into weights, in
float64:

    positions / box size        ours are centred half box sizes; sin(a + b) turns one into the other
    y-up axes                   columns change places and signs
    annealed octaves            columns of an octave are scaled
    batch statistics            (W h - mean) / sqrt(var + eps) is another W and a bias
    concatenation at a skip     W [h, e] = W_h h + W_e e
"""

import math
from collections.abc import Mapping

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.config import BendingConfig, ObjectClassConfig
from pe_runtime.geometry.native_world import WORLD_FROM_NATIVE
from pe_runtime.interop.folding import batch_statistics, folded_linear

ANNEALING_STEPS = 60000
"""Training steps after which all octaves of B's encoding are fully open."""

STEP = "ray_bender.positional_encoder.current_step"

Shapes = dict[str, tuple[int, ...]]
Table = list[tuple[str, str]]


def field_entries(config: ObjectClassConfig, features: int) -> Shapes:
    """Their names and shapes for one field, below `object_composer.object_models_coarse.N.`.

    Args:
        config: The class in our terms.
        features: Channels of all feature maps together.
    """
    field, style = config.field, config.style_features
    dimensions = 6 if config.sees_origin else 3
    encoded = dimensions * (1 + 2 * field.octaves)
    entries: Shapes = {}
    before = encoded
    for layer in range(field.depth):
        entering = before + (encoded if layer and layer == field.skip else 0)
        entries |= _linear(f"nerf_model.backbone_layers.{layer}", entering, field.width)
        before = field.width
    if not config.opaque:
        entries |= _linear("nerf_model.alpha_head", field.width, 1)
    widths = (field.width, field.head_width, field.branch_width or field.head_width)
    for index, (narrow, wide) in enumerate(zip(widths, widths[1:], strict=False)):
        head = f"nerf_model.features_head.{3 * index}"
        modulation = f"nerf_model.features_head.{3 * index + 1}"
        entries[f"{head}.weight"] = (wide, narrow)
        entries |= _linear(f"{modulation}.affine_transform", style, 2 * wide)
        entries |= batch_statistics(f"{modulation}.ada_in.normalization", wide)
    entries |= _linear("nerf_model.features_head.6", widths[-1], features)
    if config.bending is not None:
        entries |= _bending_entries(config.bending, config.pose_features)
    return entries


def _bending_entries(config: BendingConfig, pose: int) -> Shapes:
    encoded = 3 * (1 + 2 * config.octaves)
    entries: Shapes = {STEP: ()}
    before = encoded + pose
    for layer in range(config.depth):
        entering = before + (encoded + pose if layer and layer == config.skip else 0)
        entries |= _linear(f"ray_bender.backbone_layers.{layer}", entering, config.width)
        before = config.width
    return entries | {"ray_bender.output_head.weight": (3, config.width)}


def _linear(name: str, narrow: int, wide: int) -> Shapes:
    return {f"{name}.weight": (wide, narrow), f"{name}.bias": (wide,)}


def convert_field(
    theirs: Mapping[str, Tensor], config: ObjectClassConfig, up: str
) -> dict[str, Tensor]:
    """Weights of one `ObjectField` from theirs.

    Args:
        theirs: The entries of `field_entries`.
        config: The class in our terms.
        up: Up axis of their world, "z" or "y".

    Returns:
        Our names and tensors, float64; rounding to float32 is left to the caller.
    """
    theirs = {name: tensor.double() for name, tensor in theirs.items()}
    field = config.field
    octaves = torch.ones(field.octaves, dtype=torch.float64)
    turn = _sky_encoding(octaves, up) if config.sees_origin else _encoding(config, octaves, up)
    ours = _convert_trunk(theirs, turn, field.depth, field.skip)
    if not config.opaque:
        for part in ("weight", "bias"):
            ours[f"density.{part}"] = theirs[f"nerf_model.alpha_head.{part}"]
    for index in range(2):
        ours |= _convert_modulated(theirs, index)
    for part in ("weight", "bias"):
        ours[f"output.{part}"] = theirs[f"nerf_model.features_head.6.{part}"]
    if config.bending is not None:
        bent = _convert_bending(theirs, config, up)
        ours |= {f"bending.{name}": tensor for name, tensor in bent.items()}
    return ours


Turn = tuple[Float[Tensor, "theirs ours"], Float[Tensor, " theirs"]]
"""Their encoded position from ours: T e + t."""


def _convert_trunk(
    theirs: Mapping[str, Tensor], turn: Turn, depth: int, skip: int
) -> dict[str, Tensor]:
    ours = {}
    for layer in range(depth):
        name = f"nerf_model.backbone_layers.{layer}"
        weight, bias = theirs[f"{name}.weight"], theirs[f"{name}.bias"]
        if layer == 0:
            weight, bias = _turned(weight, bias, turn)
        elif layer == skip:
            hidden = weight.shape[1] - turn[0].shape[0]
            again, bias = _turned(weight[:, hidden:], bias, turn)
            ours["skip.weight"], weight = again, weight[:, :hidden]
        ours |= {f"layers.{layer}.weight": weight, f"layers.{layer}.bias": bias}
    return ours


def _convert_modulated(theirs: Mapping[str, Tensor], index: int) -> dict[str, Tensor]:
    weight = theirs[f"nerf_model.features_head.{3 * index}.weight"]
    name = f"nerf_model.features_head.{3 * index + 1}"
    weight, bias = folded_linear(weight, None, theirs, f"{name}.ada_in.normalization")
    ours = {f"head.{index}.weight": weight, f"head.{index}.bias": bias}
    for part in ("weight", "bias"):
        scale, shift = theirs[f"{name}.affine_transform.{part}"].chunk(2)
        ours |= {
            f"modulations.{index}.scale.{part}": scale,
            f"modulations.{index}.shift.{part}": shift,
        }
    return ours


def _convert_bending(
    theirs: Mapping[str, Tensor], config: ObjectClassConfig, up: str
) -> dict[str, Tensor]:
    bending = config.bending
    turn = _encoding(config, annealing(float(theirs[STEP]), bending.octaves), up)
    encoded = turn[0].shape[0]
    ours = {}
    for layer in range(bending.depth):
        name = f"ray_bender.backbone_layers.{layer}"
        weight, bias = theirs[f"{name}.weight"], theirs[f"{name}.bias"]
        if layer == 0:
            ours["pose.weight"] = weight[:, encoded:]
            weight, bias = _turned(weight[:, :encoded], bias, turn)
        elif layer == bending.skip:
            hidden = bending.width
            ours["skip_pose.weight"] = weight[:, hidden + encoded :]
            again, bias = _turned(weight[:, hidden : hidden + encoded], bias, turn)
            ours["skip_encoding.weight"], weight = again, weight[:, :hidden]
        ours |= {f"layers.{layer}.weight": weight, f"layers.{layer}.bias": bias}
    # Their displacements count in box sizes, ours in half box sizes.
    ours["output.weight"] = 2 * WORLD_FROM_NATIVE[up] @ theirs["ray_bender.output_head.weight"]
    ours["output.bias"] = torch.zeros(3, dtype=torch.float64)
    return ours


def annealing(step: float, octaves: int) -> Float[Tensor, " octaves"]:
    """Weight of each octave after so many steps, (1 - cos(pi clamp(a - k, 0, 1))) / 2."""
    progress = step * octaves / ANNEALING_STEPS
    open_by = (progress - torch.arange(octaves, dtype=torch.float64)).clamp(0.0, 1.0)
    return (1 - torch.cos(math.pi * open_by)) / 2


def _turned(weight: Tensor, bias: Tensor, turn: Turn) -> tuple[Tensor, Tensor]:
    """W (T e + t) + b as another weight and bias on e."""
    return weight @ turn[0], bias + weight @ turn[1]


def _encoding(config: ObjectClassConfig, octaves: Tensor, up: str) -> Turn:
    """Their encoding of a position from ours: q = signs (c / 2 + middle / size)."""
    low = torch.tensor(config.low, dtype=torch.float64)
    high = torch.tensor(config.high, dtype=torch.float64)
    native_from_world = WORLD_FROM_NATIVE[up].T
    shift = native_from_world @ ((low + high) / 2 / (high - low))
    return encoding_from_ours(native_from_world, shift, octaves, 0.5)


def _sky_encoding(octaves: Tensor, up: str) -> Turn:
    """Theirs is of (camera place, direction), ours of (direction, camera place)."""
    native_from_world, nothing = WORLD_FROM_NATIVE[up].T, torch.zeros(3, 3).double()
    upper = torch.cat([nothing, native_from_world], dim=1)
    lower = torch.cat([native_from_world, nothing], dim=1)
    shift = torch.zeros(6, dtype=torch.float64)
    return encoding_from_ours(torch.cat([upper, lower]), shift, octaves, 1.0)


def encoding_from_ours(
    axes: Float[Tensor, "dims dims"],
    shift: Float[Tensor, " dims"],
    octaves: Float[Tensor, " octaves"],
    scale: float,
) -> Turn:
    """Their positional encoding as a linear map T e + t of ours.

    Theirs is [q, sin q, cos q, sin 2q, ...], ours [c, sin s c, sin 2s c, ..., cos s c, ...],
    with q = A (s c) + shift; sin(2^k (a + b)) and cos(2^k (a + b)) follow from the sums of angles.

    Args:
        axes: A, a permutation with signs.
        shift: In units of q.
        octaves: Weight of each octave of theirs.
        scale: s.
    """
    dims, count = axes.shape[0], octaves.shape[0]
    matrix = torch.zeros(dims * (1 + 2 * count), dims * (1 + 2 * count), dtype=torch.float64)
    constant = torch.zeros(dims * (1 + 2 * count), dtype=torch.float64)
    matrix[:dims, :dims], constant[:dims] = scale * axes, shift
    for k, weight in enumerate(octaves):
        angle = 2.0**k * shift[:, None]
        # sin(+-a) keeps the sign, cos(+-a) loses it.
        even = axes.abs()
        sines = slice(dims * (1 + 2 * k), dims * (2 + 2 * k))
        cosines = slice(dims * (2 + 2 * k), dims * (3 + 2 * k))
        own_sines = slice(dims * (1 + k), dims * (2 + k))
        own_cosines = slice(dims * (1 + count + k), dims * (2 + count + k))
        matrix[sines, own_sines] = weight * axes * angle.cos()
        matrix[sines, own_cosines] = weight * even * angle.sin()
        matrix[cosines, own_sines] = -weight * axes * angle.sin()
        matrix[cosines, own_cosines] = weight * even * angle.cos()
    return matrix, constant
