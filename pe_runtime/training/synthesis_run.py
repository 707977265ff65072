"""A whole training of the synthesis module, from configuration and clips to a file of weights."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from pe_runtime.checkpoint import load_checkpoint, save_checkpoint
from pe_runtime.config import ModelConfig, SynthesisConfig, as_dict
from pe_runtime.curation.envelope import known_envelope
from pe_runtime.dataset import Clips
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.training.loop import Log, Moment, Schedule, run
from pe_runtime.training.processes import Team
from pe_runtime.training.synthesis_phase import SynthesisPhase, load_synthesis, prefixed


@dataclass(frozen=True)
class RunOptions:
    """How a run starts, ends and tells of itself.

    Attributes:
        minutes: Wall-clock limit; the learning-rate schedule follows it.
        resume: Go on from the run folder's checkpoint.
        start_from: Model file whose synthesis weights are the starting point.
        device: "cpu", "cuda", or "auto" for a GPU where there is one.
        on_log: Called with the step and its figures whenever a line is logged.
        on_step: Called after every step.
    """

    minutes: float | None = None
    resume: bool = False
    start_from: str | Path | None = None
    device: str = "auto"
    on_log: Callable[[int, Log], None] | None = None
    on_step: Callable[[Moment], None] | None = None


def train_synthesis(
    config: tuple[ModelConfig, SynthesisConfig],
    data: tuple[Clips, Clips | None],
    output: str | Path,
    options: RunOptions | None = None,
) -> SynthesisNetworks:
    """Train the synthesis module and write OUTPUT/synthesis.safetensors.

    Args:
        config: The model's and the training's configuration.
        data: Training clips, and held-out clips or None.
        output: Run folder.
        options: How the run starts, ends and tells of itself.
    """
    model, training = config
    options = options or RunOptions()
    team, output = Team.current(), Path(output)
    torch.manual_seed(training.seed)
    networks = SynthesisNetworks(model).to(training_device(options.device))
    if options.start_from is not None:
        load_synthesis(networks, load_checkpoint(options.start_from)[1])
    phase = SynthesisPhase(networks, *data, training)
    output.mkdir(parents=True, exist_ok=True)
    if team.leads:
        described = {"model": as_dict(model), "synthesis": as_dict(training)}
        (output / "config.json").write_text(json.dumps(described, indent=1))
    schedule = Schedule(
        steps=training.steps,
        minutes=options.minutes,
        evaluate_every=training.evaluate_every,
        checkpoint_every=training.checkpoint_every,
        seed=training.seed,
    )
    steps = run(phase, output, schedule, options.resume, options.on_log, options.on_step)
    networks.eval()
    if team.leads:
        header: dict[str, Any] = {"kind": "synthesis", "config": as_dict(model), "steps": steps}
        header |= known_envelope(data[0])
        with phase.octaves.in_weights():
            save_checkpoint(output / "synthesis.safetensors", prefixed(networks), header)
    team.wait()
    return networks


def training_device(asked: str) -> str:
    """The device for "auto": a GPU where there is one."""
    if asked != "auto":
        return asked
    return "cuda" if torch.cuda.is_available() else "cpu"
