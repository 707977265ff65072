"""Playable environments: encode a picture, step its players, render any view.

Public names load on first use, so `import pe_runtime` and `import pe_runtime.contract` stay cheap
and work in a Python without torch (Blender's).
"""

import os

# Threads that spin while they wait take turns with whatever else runs: beside one busy program a
# frame took 6.0 s instead of 0.26 s on two cores. OpenMP reads this once, when torch is loaded.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

__version__ = "0.1.0"
__all__ = ["EnvironmentState", "Frame", "ObjectState", "PlayableEnvironment", "RenderOptions"]


def __getattr__(name: str) -> object:
    """Import a public name when it is first asked for (PEP 562)."""
    if name in ("EnvironmentState", "ObjectState"):
        from . import state

        return getattr(state, name)
    if name in ("Frame", "PlayableEnvironment", "RenderOptions"):
        from . import environment

        return getattr(environment, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
