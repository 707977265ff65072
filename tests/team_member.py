"""One process of a training; run by torchrun, or called for a training in a single process."""

import os
import signal
import sys
from dataclasses import replace
from pathlib import Path

import torch
from small_world import BACKDROP, small_clips, small_config, small_training

from pe_runtime.checkpoint import save_checkpoint
from pe_runtime.config import EncoderConfig
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.training.loop import Schedule, TrainingError, run
from pe_runtime.training.processes import Team, joined
from pe_runtime.training.synthesis_phase import SynthesisPhase

STEPS = 4


def model():
    """Players with a normalised pose, and a wall seen by residual blocks with batch statistics."""
    config = small_config(width=40, height=24)
    encoder = EncoderConfig(design="residual", crop="frame", height=16, width=16, channels=(4, 8))
    backdrop = replace(BACKDROP, encoder=encoder)
    return replace(config, classes=config.classes | {"backdrop": backdrop})


def clips():
    """Sequences of which some show both players, some one, some none."""
    found = small_clips(count=6)
    boxes = found.boxes.clone()
    boxes[::2] = torch.nan
    boxes[1, :, 0] = torch.nan
    return replace(found, boxes=boxes)


def phase(**training):
    # Not the same in all processes: they have to agree on one.
    torch.manual_seed(Team.current().rank)
    settings = small_training(steps=30, **training)
    return SynthesisPhase(SynthesisNetworks(model()), clips(), None, settings)


def train(sequences):
    """A few steps without noise of the rays: weights, gradients and figures of each."""
    trained = phase(sequences=sequences, jitter=False, recoloured=0.5)
    gradients, figures = {}, {}
    for step in range(STEPS):
        torch.manual_seed(step)
        logs = trained.step(step / 30)
        figures |= {f"figures.{step}.{name}": torch.tensor(each) for name, each in logs.items()}
        for name, parameter in trained.networks.named_parameters():
            known = torch.zeros(0) if parameter.grad is None else parameter.grad.clone()
            gradients[f"gradients.{step}.{name}"] = known
        if step == 0:
            buffers = trained.networks.state_dict().items()
            found = {n: each.clone() for n, each in buffers if "running" in n or "tracked" in n}
            figures |= {f"statistics.{name}": each for name, each in found.items()}
    return trained.tensors() | gradients | figures


class Disturbed:
    """A phase to which something happens in one process after its second step."""

    def __init__(self, inner, disturbance):
        self.inner, self.disturbance, self.count = inner, disturbance, 0
        self.evaluate, self.tensors, self.restore = inner.evaluate, inner.tensors, inner.restore

    def step(self, progress):
        self.count += 1
        if self.count == 2 and Team.current().rank == 1:
            self.disturbance(self.inner)
        return self.inner.step(progress)


def terminate(_):
    os.kill(os.getpid(), signal.SIGTERM)


def spoil(trained):
    """Make one of the second process's weights, and so its loss, not finite."""
    next(iter(trained.networks.feature_renderer.parameters())).data[0] = torch.nan


def live(folder):
    """Whole, stopped and resumed, and broken runs with noise; returns what came of them."""
    schedule = Schedule(steps=STEPS, checkpoint_every=100, log_every=1)
    noisy = {"sequences": 1, "density_noise": 0.5}
    whole, resumed = phase(**noisy), phase(**noisy)
    run(whole, folder / "whole", schedule)
    made = run(Disturbed(phase(**noisy), terminate), folder / "parts", schedule)
    run(resumed, folder / "parts", schedule, resume=True)
    facts = {"made": torch.tensor(made), "broken": torch.tensor(0)}
    try:
        run(Disturbed(phase(**noisy), spoil), folder / "broken", schedule)
    except TrainingError as error:
        facts["broken"] = torch.tensor(int("broken-0000001" in str(error)))
    for name, each in (("whole", whole), ("resumed", resumed)):
        facts |= {f"{name}.{key}": tensor for key, tensor in each.tensors().items()}
    return facts


def native_threads():
    """Names of all threads of this process, those of libraries too (Linux; elsewhere none)."""
    return [each.read_text().strip() for each in Path("/proc/self/task").glob("*/comm")]


if __name__ == "__main__":
    torch.set_num_threads(1)
    folder = Path(sys.argv[1])
    with joined() as team:
        save_checkpoint(folder / f"trained-{team.rank}.safetensors", train(1), {})
        save_checkpoint(folder / f"lived-{team.rank}.safetensors", live(folder), {})
    (folder / f"threads-{team.rank}").write_text("\n".join(native_threads()))
