"""The conversation with the worker: starting it, asking it, waiting without standing still."""
