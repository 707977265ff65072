"""Training of the person detector on the recorder's exact masks, and its own figures."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from pe_runtime.checkpoint import save_checkpoint
from pe_runtime.contract.episode import Episode, read_dataset, read_episode
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.evaluation.detection import match
from pe_runtime.evaluation.detector_network import (
    KIND,
    STRIDE,
    WIDTHS,
    PersonDetector,
    SilhouetteNetwork,
)
from pe_runtime.evaluation.subject import mean_told
from pe_runtime.images import read_image

FRAMES_OF_A_SEQUENCE = 3
LARGEST_BLUR = 2
"""Pixels of the blur in training: drawn pictures are softer than recorded ones."""


@dataclass(frozen=True)
class DetectorTraining:
    """How long and on how much.

    Attributes:
        steps: Optimisation steps.
        batch: Pictures in each.
        learning_rate: Adam's, at its highest.
        seed: Of everything random.
    """

    steps: int = 600
    batch: int = 12
    learning_rate: float = 4e-3
    seed: int = 0


def train_detector(
    data: str | Path,
    output: str | Path,
    training: DetectorTraining | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Learn silhouettes of people from a recorded data set with masks, and store the network.

    Pictures are recoloured, blurred and given noise, so that what is learnt is the shape of people
    and not the sharpness of a recording.

    Args:
        data: Data set with masks; all its objects are people.
        output: File to write.
        training: Length and rates.
        progress: Called with (steps done, steps in all).

    Raises:
        EpisodeError: No episodes.
    """
    training = training or DetectorTraining()
    torch.manual_seed(training.seed)
    images, masks = silhouettes(data, FRAMES_OF_A_SEQUENCE)
    network = SilhouetteNetwork(WIDTHS)
    optimiser = torch.optim.Adam(network.parameters(), training.learning_rate)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, training.learning_rate, total_steps=training.steps, pct_start=0.1
    )
    for step in range(training.steps):
        chosen = torch.randint(len(images), (training.batch,))
        seen = distorted(images[chosen].permute(0, 3, 1, 2).float() / 255)
        logits = network(_padded(seen))[..., : seen.shape[-2], : seen.shape[-1]]
        loss = silhouette_loss(logits, masks[chosen].float())
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        optimiser.step()
        schedule.step()
        if progress is not None:
            progress(step + 1, training.steps)
    # Which data set, and not where it lay on somebody's machine.
    learnt_from = "/".join(Path(data).resolve().parts[-2:])
    header = {"kind": KIND, "widths": list(WIDTHS), "width": images.shape[2], "data": learnt_from}
    # Half precision halves the file and changes no box.
    tensors = {name: each.half() for name, each in network.state_dict().items()}
    save_checkpoint(output, tensors, header | {"steps": training.steps})
    return Path(output)


def silhouettes(data: str | Path, frames: int) -> tuple[Tensor, Tensor]:
    """Pictures (uint8, channels last) and masks (bool) of some frames of every sequence.

    Raises:
        EpisodeError: No episodes.
    """
    _, folders = read_dataset(data)
    if not folders:
        raise EpisodeError(f"{data} holds no complete sequence; finish the recording")
    pictures, masks = [], []
    for number, folder in enumerate(folders):
        episode = read_episode(folder)
        for index in range(frames):
            # Other moments in every sequence, so that all of a walk is seen.
            frame = (number + index * episode.arrays.frames // frames) % episode.arrays.frames
            pictures.append(np.round(read_image(episode.frame_path(0, frame)) * 255))
            masks.append(person_mask(episode, 0, frame))
    return torch.from_numpy(np.stack(pictures).astype(np.uint8)), torch.from_numpy(np.stack(masks))


def person_mask(episode: Episode, view: int, frame: int) -> np.ndarray:
    """Pixels of any object of the data set, from the recorder's ids."""
    ids = np.round(read_image(episode.mask_path(view, frame))[..., 0] * 255).astype(int)
    return (ids >= 1) & (ids <= len(episode.info.objects))


def silhouette_loss(
    logits: Float[Tensor, "frames height width"], masks: Float[Tensor, "frames height width"]
) -> Float[Tensor, ""]:
    """Cross entropy plus 1 - Dice, which minds the few pixels of people among the many others."""
    entropy = nn.functional.binary_cross_entropy_with_logits(logits, masks)
    shares = logits.sigmoid()
    both, either = (shares * masks).sum(), shares.sum() + masks.sum()
    return entropy + 1 - (2 * both + 1) / (either + 1)


def distorted(images: Float[Tensor, "frames 3 height width"]) -> Tensor:
    """Pictures flipped, recoloured, blurred and given noise at random.

    Flips are left out: masks would have to follow, and people are symmetric.
    """
    frames = images.shape[0]
    turn = torch.randn(frames, 3, 3) * 0.15 + torch.eye(3)
    images = torch.einsum("fab,fbhw->fahw", turn, images) + 0.08 * torch.randn(frames, 3, 1, 1)
    blur = int(torch.randint(0, LARGEST_BLUR + 1, ()))
    if blur:
        images = nn.functional.avg_pool2d(
            images, 2 * blur + 1, stride=1, padding=blur, count_include_pad=False
        )
    return (images + 0.02 * torch.randn_like(images)).clamp(0, 1)


def detector_figures(detector: PersonDetector, data: str | Path) -> dict[str, float]:
    """A detector's own mistakes on recorded pictures, against the recorder's boxes and masks.

    Returns:
        `recall` and `precision` (share of boxes matched, see `detection.match`), `centre_error`
        (mean distance of matched centres, pixels), `edge_error` (mean distance of matched edges,
        pixels), `silhouette_iou`, and `boxes`, their number.
    """
    _, folders = read_dataset(data)
    found = true = matched = 0
    centres: list[float] = []
    edges: list[float] = []
    ious: list[float] = []
    for folder in folders:
        episode = read_episode(folder)
        for frame in range(episode.arrays.frames):
            picture = read_image(episode.frame_path(0, frame))
            present = episode.arrays.present[0, frame]
            wanted = [tuple(map(float, b)) for b in episode.arrays.boxes[0, frame][present]]
            boxes, mask = detector(picture), person_mask(episode, 0, frame)
            shown = detector.silhouette(picture)
            ious.append(float((shown & mask).sum() / max((shown | mask).sum(), 1)))
            pairs = match(wanted, boxes, picture.shape[1])
            found, true, matched = found + len(boxes), true + len(wanted), matched + len(pairs)
            centres += [each.distance for each in pairs]
            edges += [
                float(np.abs(np.subtract(wanted[p.reference], boxes[p.found])).mean())
                for p in pairs
            ]
    return {
        "recall": matched / max(true, 1),
        "precision": matched / max(found, 1),
        "centre_error": mean_told(centres),
        "edge_error": mean_told(edges),
        "silhouette_iou": mean_told(ious),
        "boxes": true,
    }


def _padded(images: Tensor) -> Tensor:
    height, width = images.shape[-2:]
    extra = (0, -width % STRIDE, 0, -height % STRIDE)
    return nn.functional.pad(images, extra, mode="replicate")
