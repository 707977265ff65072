"""Files that show what the add-on is good for, made by it from nothing."""
