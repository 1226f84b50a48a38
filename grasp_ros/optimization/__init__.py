"""Numbers of a scene, chosen for an outcome."""
