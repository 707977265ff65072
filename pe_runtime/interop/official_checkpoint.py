"""From the checkpoints that the paper's authors published to one model file of ours."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import torch
from torch import Tensor

from pe_runtime.action.description import describe_by_rollout, neutral_starts
from pe_runtime.action.module import ActionModule
from pe_runtime.checkpoint import fit, save_checkpoint
from pe_runtime.config import ModelConfig, as_dict
from pe_runtime.contract.errors import CheckpointError
from pe_runtime.interop.official_entries import (
    WORLDS,
    action_parts,
    convert,
    environment_parts,
    official_config,
)
from pe_runtime.interop.official_file import OfficialFile, read_official_file
from pe_runtime.networks import SynthesisNetworks

LICENCE = "CC BY-NC 4.0, Willi Menapace and co-authors"

PLACES = {"near_player": (0.0, -10.0, 0.01), "far_player": (0.0, 10.0, 0.01)}
"""Where players are tried out, metres; others at the origin."""


@dataclass(frozen=True)
class ImportReport:
    """What an import found and wrote.

    Attributes:
        path: The model file.
        world: "tennis" or "minecraft".
        files: The files that were read, with the training step of each, if known.
        entries: How many of their entries became weights of ours.
        actions: Names of the actions by playable class; empty for a model without.
        same_environment: Whether a stage-3 file's copy of the environment equals the stage-2 file's
            weights; None where there are not two to compare.
    """

    path: Path
    world: str
    files: Mapping[str, int | None]
    entries: int
    actions: Mapping[str, tuple[str, ...]]
    same_environment: bool | None


def import_official(
    files: Sequence[str | Path], output: str | Path, world: str | None = None
) -> ImportReport:
    """Write our model file from a stage-2 checkpoint, a stage-3 checkpoint, or both.

    With both, the environment comes from the stage-2 file; a stage-3 file alone brings its copy.

    Args:
        files: One or two checkpoints of theirs, in any order.
        output: Our model file.
        world: "tennis" or "minecraft"; None to see it from the weights.

    Raises:
        CheckpointError: Files that cannot be read, do not belong together, or do not hold the
            published architecture. Nothing is written then.
    """
    read = [read_official_file(path) for path in files]
    environment, actions = _roles(read)
    found = _world_of(environment, actions, world)
    config = official_config(found)
    theirs = environment.environment
    what = f"{environment.path} (read as {found})"
    tensors = convert(environment_parts(config), theirs, what)
    _check_synthesis(config, tensors)
    facts: dict[str, object] = {"kind": "synthesis"}
    same = None
    if actions is not None:
        what = f"{actions.path} (read as {found})"
        tensors |= convert(action_parts(config, found), actions.actions, what)
        described = _described(config, tensors)
        names = {name: [each["name"] for each in rows] for name, rows in described.items()}
        facts = {"kind": "model", "actions": described, "action_names": names}
        if actions is not environment and actions.environment:
            same = _equal(actions.environment, theirs)
    steps = {each.path.name: each.step for each in read}
    facts["imported"] = {"world": found, "files": steps, "licence": LICENCE}
    save_checkpoint(output, tensors, {"config": as_dict(config), **facts})
    named = {name: tuple(each) for name, each in facts.get("action_names", {}).items()}
    used = len(theirs) + (len(actions.actions) if actions is not None else 0)
    return ImportReport(Path(output), found, steps, used, named, same)


def _roles(read: Sequence[OfficialFile]) -> tuple[OfficialFile, OfficialFile | None]:
    """Which file brings the environment and which the actions."""
    environments = [each for each in read if each.environment and not each.actions]
    playable = [each for each in read if each.actions]
    if not 1 <= len(read) <= 2 or len(environments) > 1 or len(playable) > 1:
        listed = ", ".join(f"{each.path} (stage {3 if each.actions else 2})" for each in read)
        raise CheckpointError(
            f"expected a stage-2 checkpoint, a stage-3 checkpoint, or one of each, found: {listed}"
        )
    if not environments and not playable[0].environment:
        raise CheckpointError(
            f"{playable[0].path} holds a playable model without its environment; give the stage-2 "
            "checkpoint as well"
        )
    return (environments or playable)[0], playable[0] if playable else None


def _world_of(environment: OfficialFile, actions: OfficialFile | None, asked: str | None) -> str:
    second = "object_composer.object_models_coarse.3."
    found = "tennis" if _has(environment.environment, second) else "minecraft"
    if actions is not None:
        other = "tennis" if _has(actions.actions, "object_animation_models.1.") else "minecraft"
        if other != found:
            raise CheckpointError(
                f"{environment.path} is of the {found} world, {actions.path} of {other}: give two "
                "checkpoints of one world"
            )
    if asked is not None and asked not in WORLDS:
        raise CheckpointError(f"no world {asked!r}; there are: {', '.join(WORLDS)}")
    if asked not in (None, found):
        raise CheckpointError(
            f"{environment.path} was to be {asked}, but its objects are those of {found}"
        )
    return found


def _has(entries: Mapping[str, Tensor], prefix: str) -> bool:
    return any(name.startswith(prefix) for name in entries)


def _equal(first: Mapping[str, Tensor], second: Mapping[str, Tensor]) -> bool:
    return first.keys() == second.keys() and all(torch.equal(first[n], second[n]) for n in first)


def _check_synthesis(config: ModelConfig, tensors: Mapping[str, Tensor]) -> None:
    own = {name.removeprefix("synthesis."): tensor for name, tensor in tensors.items()}
    fit(SynthesisNetworks(config).state_dict(), own, "the imported synthesis module")


def _described(config: ModelConfig, tensors: Mapping[str, Tensor]) -> dict[str, list[dict]]:
    """Names of the actions of each playable class, by doing them."""
    described = {}
    for name, each in config.classes.items():
        prefix = f"actions.{name}."
        if not _has(tensors, prefix):
            continue
        module = ActionModule(config.action, each.style_features, each.pose_features).eval()
        own = {n.removeprefix(prefix): t for n, t in tensors.items() if n.startswith(prefix)}
        fit(module.state_dict(), own, f"the imported action module of {name!r}")
        module.load_state_dict(own)
        starts = neutral_starts(module, PLACES.get(name, (0.0, 0.0, 0.0)))
        described[name] = [asdict(action) for action in describe_by_rollout(module, starts)]
    return described
