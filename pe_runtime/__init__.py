"""Playable environments: encode a picture, step its players, render any view.

Public names load on first use, so `import pe_runtime` and `import pe_runtime.contract` stay cheap
and work in a Python without torch (Blender's).
"""

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
