"""Whole checkpoints of the authors' release and the models made of them, once a session."""

import pytest
from interop.official_weights import action_weights, environment_weights, save_stage

from pe_runtime.environment import PlayableEnvironment
from pe_runtime.interop.official_checkpoint import import_official

WORLDS = ("tennis", "minecraft")


@pytest.fixture(scope="session")
def weights():
    return {w: (environment_weights(w), action_weights(w)) for w in WORLDS}


@pytest.fixture(scope="session")
def files(weights, tmp_path_factory):
    """Stage-2 and whole stage-3 checkpoints of both worlds."""
    folder, made = tmp_path_factory.mktemp("official"), {}
    for world, (environment, actions) in weights.items():
        copy = {f"environment_model.{name}": tensor for name, tensor in environment.items()}
        made[world] = (
            save_stage(folder / f"{world}_2.pth.tar", environment),
            save_stage(folder / f"{world}_3.pth.tar", {**copy, **actions}, step=150000),
        )
    return made


@pytest.fixture(scope="session")
def models(files, tmp_path_factory):
    """Both worlds imported from their stage-3 files alone."""
    folder = tmp_path_factory.mktemp("models")
    reports = {w: import_official([files[w][1]], folder / f"{w}.safetensors") for w in WORLDS}
    return {
        w: (report, PlayableEnvironment.load(report.path, "cpu")) for w, report in reports.items()
    }
