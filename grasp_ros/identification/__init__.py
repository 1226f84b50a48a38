"""Numbers of a scene from a measured motion, with what the motion says of them and what it does not."""
