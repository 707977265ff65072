"""Volume rendering: rays through object volumes, composed and decoded to images."""
