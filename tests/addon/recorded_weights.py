"""Whole checkpoints of the authors' release: recorded weights where at hand, the rest seeded."""

import pytest
from interop.official_weights import action_weights, environment_weights, save_stage
from parity.parity_files import parity_case

from pe_runtime.interop.official_checkpoint import import_official
from pe_runtime.interop.official_file import ENVIRONMENT

GAIN = 2.2
"""Seeded weights are larger by this than official_weights makes them: those draw one flat grey."""


def recorded(name, entry):
    """The recorded weights of one case, float32; nothing where it is not at hand."""
    try:
        found = parity_case(name)[entry]
    except pytest.skip.Exception:
        return {}
    return {n: each.float() if each.is_floating_point() else each for n, each in found.items()}


def for_both(weights, first, second):
    """Weights that were recorded of one player, for the other too."""
    return weights | {n.replace(first, second, 1): each for n, each in weights.items()}


def stage_3(world):
    """A stage-3 model as it is stored: actions, and the environment below its prefix."""
    environment = recorded(f"{world}_render", "state_dict_fp16")
    actions = {}
    if world == "tennis":
        encoder = recorded("tennis_encoder", "state_dict")
        environment |= for_both(encoder, "object_encoders.2.", "object_encoders.3.")
        actions = for_both(recorded("tennis_actions", "state_dict"), "models.0.", "models.1.")
    whole = environment_weights(world, environment)
    if not environment:
        whole = {n: each * GAIN if each.ndim >= 2 else each for n, each in whole.items()}
    copy = {ENVIRONMENT + name: each for name, each in whole.items()}
    return action_weights(world, actions) | copy


def imported_model(folder, world):
    """Path of the model file that the import makes of such a checkpoint."""
    stored = save_stage(folder / "checkpoint_300000_.pth.tar", stage_3(world))
    report = import_official([stored], folder / f"{world}.safetensors")
    assert report.world == world
    stored.unlink()
    return report.path
