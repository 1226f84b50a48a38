"""Motion in contact: Taylor steps in regularised time."""
