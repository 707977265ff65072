"""The words both programs share: cameras, shots, episodes, messages, errors.

Standard library and numpy only. Blender's Python imports this package without torch.
"""
