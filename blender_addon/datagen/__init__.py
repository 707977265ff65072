"""Scenes made or opened by Blender, recorded as training episodes."""
