"""The add-on as one zip: what goes into it, and whether it may."""
