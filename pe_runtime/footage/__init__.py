"""What a picture that someone filmed says of the camera that filmed it."""
