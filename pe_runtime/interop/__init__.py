"""What the paper's authors published, in our terms: checkpoints, conventions and data sets."""
