"""The demo: one picture becomes a Blender scene, a baked roll-out, frames, a strip and a film."""

from pe_runtime.demo.film import DemoError, DemoOptions, run_demo
from pe_runtime.demo.passing_cube import run_passing_cube

__all__ = ["DemoError", "DemoOptions", "run_demo", "run_passing_cube"]
