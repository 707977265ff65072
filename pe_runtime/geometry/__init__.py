"""Cameras, rays, boxes and the ground plane, as pure functions on tensors."""
