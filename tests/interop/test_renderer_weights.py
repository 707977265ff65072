"""The imported decoder computes what the authors' does: against loops, batch statistics and all."""

import numpy as np
import pytest
import torch
from interop.official_weights import seeded

from pe_runtime.config import FeatureRendererConfig
from pe_runtime.interop.renderer_weights import convert_renderer, renderer_entries
from pe_runtime.rendering.paper_renderer import PaperFeatureRenderer

SMALL = {
    activated: FeatureRendererConfig(
        design="paper", activated_blocks=activated, strides=(4, 8), features=(3, 5), widths=(4, 5),
        output_widths=(3, 2), blocks=3,
    )
    for activated in (False, True)
}  # fmt: skip


def reflected(index, size):
    return -index if index < 0 else 2 * (size - 1) - index if index >= size else index


def convolved(image, weight):
    """A convolution with reflected borders, one pixel after the other."""
    margin, (_, height, width) = weight.shape[-1] // 2, image.shape
    out = np.zeros((weight.shape[0], height, width))
    for row in range(height):
        for column in range(width):
            for i in range(-margin, margin + 1):
                for j in range(-margin, margin + 1):
                    pixel = image[:, reflected(row + i, height), reflected(column + j, width)]
                    out[:, row, column] += weight[:, :, i + margin, j + margin] @ pixel
    return out


def normalised(image, tensors, name):
    mean, var = tensors[f"{name}.running_mean"], tensors[f"{name}.running_var"]
    scale, shift = tensors[f"{name}.weight"], tensors[f"{name}.bias"]
    unit = (image - mean[:, None, None]) / np.sqrt(var + 1e-5)[:, None, None]
    return unit * scale[:, None, None] + shift[:, None, None]


def block(image, tensors, name):
    """Residual block of theirs: convolution, statistics, ReLU, convolution, statistics, sum."""
    inner = convolved(image, tensors[f"{name}.conv_block.1.weight"])
    inner = np.maximum(normalised(inner, tensors, f"{name}.conv_block.2"), 0)
    inner = convolved(inner, tensors[f"{name}.conv_block.5.weight"])
    inner = normalised(inner, tensors, f"{name}.conv_block.6")
    shortcut = f"{name}.residual_connection_convolution"
    if f"{shortcut}.0.weight" in tensors:
        image = convolved(image, tensors[f"{shortcut}.0.weight"])
        image = normalised(image, tensors, f"{shortcut}.1")
    return image + inner


def doubled(image):
    """Bilinear, corner pixels on corner pixels."""
    channels, height, width = image.shape
    out = np.zeros((channels, 2 * height, 2 * width))
    for row in range(2 * height):
        for column in range(2 * width):
            y = row * (height - 1) / (2 * height - 1)
            x = column * (width - 1) / (2 * width - 1)
            top, left = min(int(y), height - 2), min(int(x), width - 2)
            a, b = y - top, x - left
            upper = (1 - b) * image[:, top, left] + b * image[:, top, left + 1]
            lower = (1 - b) * image[:, top + 1, left] + b * image[:, top + 1, left + 1]
            out[:, row, column] = (1 - a) * upper + a * lower
    return out


def risen(image, tensors, level, number):
    name = f"upsample_blocks.{level}"
    image = convolved(doubled(image), tensors[f"{name}.{number}.weight"])
    return np.maximum(normalised(image, tensors, f"{name}.{number + 1}"), 0)


def decoded(fine, coarse, tensors, activated):
    """Their decoder, v7 (activated) or v6, as the facts describe it."""
    blocks = (0, 2, 4) if activated else (0, 1, 2)
    first = 7 if activated else 4
    image = coarse
    for level in (0, 1):
        for number in blocks:
            image = block(image, tensors, f"upsample_blocks.{level}.{number}")
            image = np.maximum(image, 0) if activated else image
        image = risen(image, tensors, level, first)
        if level == 0:
            image = np.concatenate([image, fine])
    image = risen(image, tensors, 1, first + 4)
    image = convolved(image, tensors["final_convolutions.1.weight"])
    image = image + tensors["final_convolutions.1.bias"][:, None, None]
    return 1 / (1 + np.exp(-image))


@pytest.mark.parametrize("activated", [False, True])
def test_the_decoder_gives_what_the_loops_give(activated):
    config = SMALL[activated]
    theirs = seeded(renderer_entries(config), seed=4)
    generator = torch.Generator().manual_seed(5)
    maps = [
        torch.randn(1, 3, 6, 8, generator=generator),
        torch.randn(1, 5, 3, 4, generator=generator),
    ]
    renderer = PaperFeatureRenderer(config).double()
    renderer.load_state_dict(convert_renderer(theirs, config))
    with torch.no_grad():
        ours = renderer([each.double() for each in maps])[0]
    tensors = {name: tensor.double().numpy() for name, tensor in theirs.items()}
    wanted = decoded(*(each[0].double().numpy() for each in maps), tensors, activated)
    assert ours.shape == (3, 24, 32)
    # The last step is float32, as in every design.
    assert np.abs(ours.numpy() - wanted).max() < 1e-6
    assert wanted.std() > 0.01


def test_the_published_sizes_are_those_of_the_paper():
    config = FeatureRendererConfig(
        design="paper", strides=(4, 8), features=(64, 128), widths=(64, 128),
        output_widths=(32, 16), blocks=3,
    )  # fmt: skip
    entries = renderer_entries(config)
    assert entries["upsample_blocks.0.0.conv_block.1.weight"] == (128, 128, 3, 3)
    assert entries["upsample_blocks.1.0.residual_connection_convolution.0.weight"] == (
        64,
        128,
        1,
        1,
    )
    assert entries["upsample_blocks.1.8.weight"] == (16, 32, 3, 3)
    assert len(entries) == 98
