"""A VGG of few channels with random weights, under torchvision's names."""

import torch
from torch import nn

from pe_runtime.checkpoint import save_checkpoint

PLANS = {
    "vgg16": "1 1 M 2 2 M 3 3 3 M 4 4 4 M 4 4 4 M",
    "vgg19": "1 1 M 2 2 M 3 3 3 3 M 4 4 4 4 M 4 4 4 4 M",
}


def thin_vgg(design="vgg16", width=3, seed=0):
    """The `features` of torchvision's network, `width` channels where it has 64."""
    layers, narrow = [], 3
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        for each in PLANS[design].split():
            if each == "M":
                layers.append(nn.MaxPool2d(2, 2))
                continue
            wide = int(each) * width
            layers += [nn.Conv2d(narrow, wide, 3, padding=1), nn.ReLU()]
            narrow = wide
    return nn.Sequential(*layers)


def state_of(features):
    """Its state dict, with a classifier that nobody needs."""
    tensors = {f"features.{name}": each for name, each in features.state_dict().items()}
    return tensors | {"classifier.0.weight": torch.zeros(2, 2), "classifier.0.bias": torch.zeros(2)}


def write_vgg(path, design="vgg16", width=3, seed=0):
    """Write such a file, .safetensors or .pth; returns its path."""
    tensors = state_of(thin_vgg(design, width, seed))
    if path.suffix == ".pth":
        torch.save(tensors, path)
    else:
        save_checkpoint(path, tensors, {})
    return path
