"""From a picture to the environment state: positions, styles and poses."""
