"""What every test may rely on: the same examples each run, quiet threads, skips that say why."""

import importlib.util
import os
import sys

import pytest
from hypothesis import settings

# Small tensors on few cores: more threads cost more than they bring.
os.environ.setdefault("OMP_NUM_THREADS", "1")

EXIT_STATUS = pytest.StashKey[int]()

settings.register_profile("house", derandomize=True, deadline=None, max_examples=60)
settings.load_profile("house")


def pytest_collection_modifyitems(items):
    """Skip tests of Blender or CUDA where those are missing, and say so."""
    missing = {"blender": importlib.util.find_spec("bpy") is None, "gpu": not _has_cuda(items)}
    for item in items:
        for name, absent in missing.items():
            if absent and item.get_closest_marker(name):
                item.add_marker(pytest.mark.skip(reason=f"needs {name}, not on this machine"))


def _has_cuda(items):
    if not any(item.get_closest_marker("gpu") for item in items):
        return False
    import torch

    return torch.cuda.is_available()


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session, exitstatus):
    session.config.stash[EXIT_STATUS] = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    """Leave at once under Blender 4.5, which as a module can wait for ever in its own way out."""
    bpy = sys.modules.get("bpy")
    if bpy is not None and bpy.app.version < (5, 0, 0) and EXIT_STATUS in config.stash:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(config.stash[EXIT_STATUS])
