"""Feature fields: what a point of an object looks like, and how dense it is."""
