"""Clips through the frozen encoder: the state sequences that actions are learnt from."""

from collections.abc import Callable

import torch

from pe_runtime.dataset import Clips
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.training.action_sequences import ActionDataset, join


@torch.no_grad()
def encode_clips(
    networks: SynthesisNetworks,
    clips: Clips,
    class_name: str,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> ActionDataset:
    """Encode every frame of every clip and collect the sequences of one playable class.

    Sequences in which an object is not found in every frame are left out: the action module has
    no notion of absence.

    Args:
        networks: Trained synthesis module; put into evaluation mode.
        clips: The recorded sequences.
        class_name: The playable class.
        on_progress: Called with clips done and clips in all.

    Returns:
        One sequence per clip and object of the class.

    Raises:
        EpisodeError: No sequence has an object that is found throughout.
    """
    networks.eval()
    device = next(networks.parameters()).device
    names = [o.name for o in networks.config.objects if o.class_name == class_name]
    length = clips.images.shape[1]
    found: list[ActionDataset] = []
    for clip in range(len(clips)):
        times = torch.arange(length)
        batch = clips.batch(torch.full_like(times, clip), times).to(device)
        codes = networks.encode(batch.images, batch.cameras, batch.boxes)
        for name in names:
            each = codes[name]
            if not bool(each.visible.all()):
                continue
            actions = clips.actions[clip, :, clips.players.index(name)]
            found.append(
                ActionDataset(
                    each.position[None],
                    each.style.mean(dim=0)[None],
                    each.pose[None],
                    batch.cameras.rotations.float()[None],
                    actions[None] if bool((actions >= 0).all()) else None,
                    None if each.heading is None else each.heading[None],
                )
            )
        on_progress(clip + 1, len(clips))
    return join(found)
