"""The render engine: frames as the scene wants them, to the byte, or a loud failure."""
