"""Run time against error: how fast each render quality is, and how far from the truth."""
