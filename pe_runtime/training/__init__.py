"""Training of the synthesis module and of the action module, with one loop for both."""
