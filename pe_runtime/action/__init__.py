"""Action networks: what an object did between two states, and what it does next."""
