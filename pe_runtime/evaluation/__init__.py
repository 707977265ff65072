"""Figures of merit: what the model shows (visual) and how its players move (motion)."""
