"""From a trained synthesis module to a whole model: actions learnt, named and stored with it."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from pe_runtime.action.description import KnownActions, describe_actions
from pe_runtime.action.module import ActionModule
from pe_runtime.checkpoint import load_checkpoint, save_checkpoint
from pe_runtime.config import ModelConfig, as_dict, from_dict
from pe_runtime.contract.envelope import ENVELOPE_KEY
from pe_runtime.contract.errors import ConfigError
from pe_runtime.curation.envelope import known_envelope
from pe_runtime.dataset import Clips
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.training.action_config import ActionTrainingConfig
from pe_runtime.training.action_phase import ActionPhase
from pe_runtime.training.action_sequences import ActionDataset
from pe_runtime.training.encoded_clips import encode_clips
from pe_runtime.training.loop import Log, Moment, Schedule, run
from pe_runtime.training.pruning import with_actions
from pe_runtime.training.synthesis_phase import load_synthesis, prefixed


def train_model_actions(
    synthesis: str | Path,
    clips: Clips,
    training: ActionTrainingConfig,
    output: str | Path,
    resume: bool = False,
    on_log: Callable[[int, Log], None] | None = None,
    on_step: Callable[[Moment], None] | None = None,
) -> Path:
    """Learn the actions of every playable class and write OUTPUT/model.safetensors.

    No label enters the training. Where the recorder knows what was done, it only helps to name
    the discovered actions.

    Args:
        synthesis: Trained synthesis module, or a model whose actions are learnt anew.
        clips: The recorded sequences.
        training: Schedule and losses.
        output: Run folder; each class gets a folder of its own in it.
        resume: Go on from the run folder's checkpoints.
        on_log: Called with the step and its figures.
        on_step: Called after every step.

    Returns:
        The model's file.

    Raises:
        ConfigError: The model has no playable class.
    """
    header, tensors = load_checkpoint(synthesis)
    config = from_dict(ModelConfig, header["config"], f"configuration of {synthesis}")
    if training.dynamics_frame != "model":
        action = replace(config.action, movement_frame=training.dynamics_frame)
        config = replace(config, action=action)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    networks = SynthesisNetworks(config).to(device)
    load_synthesis(networks, tensors)
    playable = [name for name, each in config.classes.items() if each.kind == "playable"]
    if not playable:
        raise ConfigError(f"{synthesis} has no playable class; there are no actions to learn")
    modules: dict[str, ActionModule] = {}
    judges: dict[str, nn.Module] = {}
    described: dict[str, list[dict[str, Any]]] = {}
    for name in playable:
        dataset = encode_clips(networks, clips, name)
        phase = ActionPhase(dataset, config.action, training)
        if training.go_on:
            phase.start_from(_own(tensors, f"actions.{name}."), _own(tensors, f"judges.{name}."))
        schedule = Schedule(
            steps=training.steps,
            log_every=training.log_every,
            evaluate_every=training.log_every,
            checkpoint_every=training.checkpoint_every,
            seed=training.seed,
        )
        run(phase, Path(output) / name, schedule, resume, on_log, on_step)
        modules[name], judges[name] = phase.module.eval(), phase.judge
        if len(playable) == 1:
            modules[name] = _without_unused(modules[name], dataset)
            config = replace(config, action=modules[name].config)
        known = None
        if dataset.true_actions is not None and clips.action_names:
            known = KnownActions(dataset.true_actions, clips.action_names)
        found = describe_actions(modules[name], dataset.sequences(), known)
        described[name] = [asdict(each) for each in found]
    path = Path(output) / "model.safetensors"
    facts = {
        "training": {"synthesis_steps": header.get("steps"), "actions": asdict(training)},
        "actions": described,
        "action_names": {n: [d["name"] for d in each] for n, each in described.items()},
    }
    # Of the pictures that the drawing was learnt from, where the file knows them.
    own = {ENVELOPE_KEY: header[ENVELOPE_KEY]} if ENVELOPE_KEY in header else known_envelope(clips)
    write_model(path, config, networks, modules, facts | own, judges)
    return path


def _without_unused(module: ActionModule, data: ActionDataset) -> ActionModule:
    """The module without actions that no training step is; several classes share their number."""
    taken = torch.unique(module.infer(data.sequences())).tolist()
    if len(taken) == module.config.actions or module.config.discriminator == "states":
        return module
    return with_actions(module, taken, (data.styles.shape[1], data.poses.shape[2]))


def write_model(
    path: str | Path,
    config: ModelConfig,
    networks: SynthesisNetworks,
    modules: dict[str, ActionModule],
    facts: dict[str, Any],
    judges: Mapping[str, nn.Module] | None = None,
) -> None:
    """Store all networks of a model in one file that `PlayableEnvironment.load` reads.

    Args:
        path: Where to.
        config: The environment.
        networks: Its synthesis module.
        modules: Action module of each playable class.
        facts: Further facts for the header; `action_names` is what users see.
        judges: Discriminator of each playable class, which only a further training reads.
    """
    tensors = prefixed(networks)
    for kind, trained in (("actions", modules), ("judges", judges or {})):
        for name, module in trained.items():
            tensors |= {f"{kind}.{name}.{key}": t for key, t in module.state_dict().items()}
    save_checkpoint(path, tensors, {"kind": "model", "config": as_dict(config), **facts})


def _own(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """The tensors below a prefix, without it."""
    return {n[len(prefix) :]: t for n, t in tensors.items() if n.startswith(prefix)}
