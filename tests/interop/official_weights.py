"""Checkpoints like those of the authors' release, with seeded random weights."""

import torch

from pe_runtime.interop.official_entries import action_parts, environment_parts, official_config

NEVER_RUN = {
    "camera_parameters_offsets.storage.storage.0": (7,),
    "autoencoder_model.encoder.initial_convolution.1.weight": (16, 3, 7, 7),
    "autoencoder_model.encoder.initial_convolution.2.num_batches_tracked": (),
}


def seeded(shapes, seed):
    """Random entries of a sane size: variances positive, counters integers."""
    generator = torch.Generator().manual_seed(seed)
    return {name: _entry(name, shape, generator) for name, shape in shapes.items()}


def _entry(name, shape, generator):
    if name.endswith("num_batches_tracked"):
        return torch.tensor(0)
    if name.endswith("current_step"):
        return torch.tensor(60000, dtype=torch.int32)
    numbers = torch.randn(shape, generator=generator)
    if name.endswith(("running_var", "running_std")):
        return 0.5 + numbers.abs()
    if len(shape) < 2:
        return 0.1 * numbers
    return numbers / max(1, numbers[0].numel()) ** 0.5


def environment_shapes(world):
    """Names and shapes of a stage-2 model."""
    parts = environment_parts(official_config(world))
    shapes = {part.theirs + name: shape for part in parts for name, shape in part.entries.items()}
    return NEVER_RUN | shapes


def action_shapes(world):
    """Names and shapes of a stage-3 model without its copy of the environment."""
    parts = action_parts(official_config(world), world)
    return {part.theirs + name: shape for part in parts for name, shape in part.entries.items()}


def environment_weights(world, known=None, seed=0):
    """A stage-2 model: what is known, the rest random."""
    known = known or {}
    shapes = {n: s for n, s in environment_shapes(world).items() if n not in known}
    return {**seeded(shapes, seed), **known}


def action_weights(world, known=None, seed=1):
    """A stage-3 model without its copy of the environment: what is known, the rest random."""
    known = known or {}
    shapes = {n: s for n, s in action_shapes(world).items() if n not in known}
    return {**seeded(shapes, seed), **known}


def save_stage(path, model, step=300000):
    """Write a model as a training of theirs would."""
    optimizer = {"state": {}, "param_groups": [{"lr": 1e-4, "params": [0]}]}
    torch.save({"model": model, "optimizer": optimizer, "lr_scheduler": {}, "step": step}, path)
    return path
