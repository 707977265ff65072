"""A small person detector: pictures in, silhouettes and boxes out; it knows no model.

Nothing that a registry offers finds people 30 to 100 pixels tall reliably offline (see the README's
limits), so this one is trained on the recorder's exact masks (`detector_training`). It looks at
pictures only, recorded ones and drawn ones alike.
"""

from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float
from scipy import ndimage
from torch import Tensor, nn

from pe_runtime.checkpoint import fit, load_checkpoint
from pe_runtime.contract.errors import CheckpointError
from pe_runtime.evaluation.detection import Box
from pe_runtime.evaluation.rules import RULES

KIND = "detector"
WIDTHS = (12, 20, 28, 36)
"""Channels at strides 2, 4, 8 and 16."""
STRIDE = 16


class SilhouetteNetwork(nn.Module):
    """A U-Net from a picture to logits of "a person is here", at the picture's resolution.

    Args:
        widths: Channels at strides 2, 4, 8 and 16.
    """

    def __init__(self, widths: tuple[int, ...] = WIDTHS) -> None:
        super().__init__()
        self.down = nn.ModuleList(
            _block(narrow, wide, stride=2)
            for narrow, wide in zip((3, *widths[:-1]), widths, strict=True)
        )
        self.up = nn.ModuleList(
            _block(wide + narrow, narrow, stride=1)
            for narrow, wide in zip(widths[:-1], widths[1:], strict=True)
        )
        self.output = nn.Conv2d(widths[0], 4, 3, padding=1)

    def forward(
        self, images: Float[Tensor, "frames 3 height width"]
    ) -> Float[Tensor, "frames height width"]:
        """Logits; sides are multiples of 16 (see `STRIDE`)."""
        hidden, kept = images - 0.5, []
        for block in self.down:
            hidden = block(hidden)
            kept.append(hidden)
        for block, skip in zip(reversed(self.up), reversed(kept[:-1]), strict=True):
            larger = nn.functional.interpolate(hidden, skip.shape[-2:], mode="nearest")
            hidden = block(torch.cat([larger, skip], dim=1))
        # Four logits per cell of stride 2 are the four pixels in it.
        return nn.functional.pixel_shuffle(self.output(hidden), 2)[:, 0]


class PersonDetector:
    """Finds people in pictures: connected silhouettes and the boxes around them.

    Args:
        network: Trained network.
        width: Pixel columns of the pictures it was trained on; others are resized to it.
    """

    name = "own"

    def __init__(self, network: SilhouetteNetwork, width: int) -> None:
        self.network, self.width = network.eval(), width

    def silhouette(
        self, picture: Float[np.ndarray, "height width 3"]
    ) -> Bool[np.ndarray, "height width"]:
        """Pixels that show a person."""
        return self.logits(picture) > 0

    @torch.inference_mode()
    def logits(
        self, picture: Float[np.ndarray, "height width 3"]
    ) -> Float[np.ndarray, "height width"]:
        """Per pixel how sure it is that it shows a person, as a logit."""
        height, width = picture.shape[:2]
        share = self.width / width
        size = (self.width, max(1, round(height * share)))
        scaled = picture if share == 1 else cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        image = torch.from_numpy(np.ascontiguousarray(scaled)).float().permute(2, 0, 1)[None]
        rows, columns = (-(-side // STRIDE) * STRIDE for side in image.shape[-2:])
        extra = (0, columns - image.shape[-1], 0, rows - image.shape[-2])
        logits = self.network(nn.functional.pad(image, extra, mode="replicate"))[0]
        logits = logits[: size[1], : size[0]].numpy()
        if share != 1:
            logits = cv2.resize(logits, (width, height), interpolation=cv2.INTER_LINEAR)
        return logits

    def __call__(self, picture: Float[np.ndarray, "height width 3"]) -> list[Box]:
        """Boxes of the people in a picture, (left, top, right, bottom) pixel edges."""
        return component_boxes(self.silhouette(picture))


def component_boxes(mask: Bool[np.ndarray, "height width"]) -> list[Box]:
    """Boxes around the connected parts of a mask, largest first; specks are left out.

    A limb that a thin gap cuts off belongs to its body: parts are joined across two pixels.
    """
    joined = ndimage.binary_dilation(mask, iterations=1)
    labels, count = ndimage.label(joined, structure=np.ones((3, 3)))
    labels = np.where(mask, labels, 0)
    found = []
    for index, place in enumerate(ndimage.find_objects(labels, count), start=1):
        area = int((labels[place] == index).sum()) if place is not None else 0
        if area >= RULES.smallest_person * mask.size:
            rows, columns = place
            edges = (columns.start, rows.start, columns.stop, rows.stop)
            found.append((area, tuple(float(edge) for edge in edges)))
    return [box for _, box in sorted(found, reverse=True)]


def load_detector(path: str | Path) -> PersonDetector:
    """Read a detector that `pe train detector` wrote.

    Raises:
        CheckpointError: No such file, or it is no detector.
    """
    header, tensors = load_checkpoint(path)
    if header.get("kind") != KIND:
        raise CheckpointError(
            f"{path} is no detector but of kind {header.get('kind')!r}; train one with "
            "`pe train detector`"
        )
    network = SilhouetteNetwork(tuple(header["widths"]))
    return PersonDetector(filled(network, tensors, f"the detector of {path}"), header["width"])


def filled(
    network: SilhouetteNetwork, tensors: Mapping[str, Tensor], what: str
) -> SilhouetteNetwork:
    """The network with stored weights, which may be of half precision."""
    wanted = network.state_dict()
    fit(wanted, tensors, what)
    network.load_state_dict({name: tensors[name].to(wanted[name].dtype) for name in wanted})
    return network


def _block(narrow: int, wide: int, stride: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(narrow, wide, 3, stride=stride, padding=1),
        nn.GroupNorm(4, wide),
        nn.ReLU(),
        nn.Conv2d(wide, wide, 3, padding=1),
        nn.GroupNorm(4, wide),
        nn.ReLU(),
    )
