"""`pe train synthesis` and `pe train actions`."""

import dataclasses
import os
from pathlib import Path
from typing import Annotated

import typer

from pe_runtime.cli.option_groups import grouped
from pe_runtime.cli.terminal import device, shared, show
from pe_runtime.cli.watching import watching
from pe_runtime.contract.errors import ConfigError

app = typer.Typer(help="Train a model: first what it sees, then what it can do.")
Config = Annotated[Path, typer.Option(help="TOML with the sections model, synthesis, actions.")]
Data = Annotated[Path, typer.Option(help="Data set to train on.")]
Output = Annotated[Path, typer.Option("--out", "-o", help="Run folder.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on from the run's checkpoint.")]
Steps = Annotated[int | None, typer.Option(min=1, help="Instead of the configured number.")]
Watch = Annotated[bool, typer.Option("--watch", help="A live line instead of a log.")]


@dataclasses.dataclass(frozen=True)
class SynthesisChoices:
    """The options of `pe train synthesis` that say how it is run."""

    val: Annotated[Path | None, typer.Option(help="Held-out data set for measurements.")] = None
    resume: Resume = False
    minutes: Annotated[float | None, typer.Option(help="Wall-clock limit.")] = None
    steps: Steps = None
    vgg: Annotated[
        Path | None, typer.Option(help="Weights of VGG16 or VGG19 for the perceptual loss.")
    ] = None
    watch: Watch = False
    start_from: Annotated[
        Path | None, typer.Option(help="Model whose weights to go on from, of the same sizes.")
    ] = None
    ablation: Annotated[
        str | None,
        typer.Option(
            help="Leave out what a row of the paper's table lacks: plain, multi, multi-pose, "
            "concatenation, modulation, single-resolution or full."
        ),
    ] = None


@dataclasses.dataclass(frozen=True)
class ActionChoices:
    """The options of `pe train actions` that say how it is run."""

    resume: Resume = False
    steps: Steps = None
    watch: Watch = False
    ablation: Annotated[
        str | None,
        typer.Option(
            help="Leave out what a row of the paper's table lacks: A, B, C, D, E or full."
        ),
    ] = None


@app.command()
@shared
@grouped
def synthesis(config: Config, data: Data, output: Output, chosen: SynthesisChoices) -> None:
    """Train encoder, fields and feature renderer; writes OUTPUT/synthesis.safetensors.

    `torchrun --nproc-per-node N -m pe_runtime.cli train synthesis ...` trains with N processes,
    each with a batch as configured.
    """
    _let_threads_sleep()
    from pe_runtime.config import ModelConfig, SynthesisConfig, read_toml
    from pe_runtime.config.ablations import ablated_synthesis
    from pe_runtime.dataset import load_clips
    from pe_runtime.training.processes import joined
    from pe_runtime.training.synthesis_run import RunOptions, train_synthesis

    model = read_toml(config, "model", ModelConfig)
    training = read_toml(config, "synthesis", SynthesisConfig)
    changes = {} if chosen.steps is None else {"steps": chosen.steps}
    if chosen.vgg is not None:
        changes |= {"perceptual": "vgg", "perceptual_weights": str(chosen.vgg)}
    training = dataclasses.replace(training, **changes)
    if chosen.ablation is not None:
        model, training = ablated_synthesis(model, training, chosen.ablation)
    clips = load_clips(data), load_clips(chosen.val) if chosen.val else None
    with joined(device()) as team, watching(chosen.watch and team.leads) as told:
        options = RunOptions(chosen.minutes, chosen.resume, chosen.start_from, device(), *told)
        train_synthesis((model, training), clips, output, options)
    if team.leads:
        show({"model": str(output / "synthesis.safetensors")})


@app.command()
@shared
@grouped
def actions(
    checkpoint: Annotated[Path, typer.Option(help="Trained synthesis module.")],
    config: Config,
    data: Data,
    output: Output,
    chosen: ActionChoices,
) -> None:
    """Learn the actions of a trained model's players; writes OUTPUT/model.safetensors."""
    _let_threads_sleep()
    if int(os.environ.get("WORLD_SIZE", "1")) > 1:
        raise ConfigError(
            "actions are learnt in one process, in minutes; start it without torchrun"
        )
    from pe_runtime.config import read_toml
    from pe_runtime.dataset import load_clips
    from pe_runtime.training.action_config import ActionTrainingConfig, ablated_actions
    from pe_runtime.training.model_file import train_model_actions

    training = read_toml(config, "actions", ActionTrainingConfig)
    if chosen.steps is not None:
        training = dataclasses.replace(training, steps=chosen.steps)
    if chosen.ablation is not None:
        training = ablated_actions(training, chosen.ablation)
    clips, resume = load_clips(data), chosen.resume
    with watching(chosen.watch) as told:
        file = train_model_actions(checkpoint, clips, training, output, resume, *told)
    show({"model": str(file)})


def _let_threads_sleep() -> None:
    """Let threads sleep while they wait for each other, for hours of training beside other work.

    Threads that spin take turns with whatever else runs: beside one busy program a step took twenty
    times as long. OpenMP reads this once, when torch is loaded. Drawing, whose frames are short,
    minds its threads itself (`fair_threads`); waking them would take longer than spinning.
    """
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
