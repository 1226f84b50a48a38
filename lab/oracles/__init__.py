"""What decides whether a run is right: exact relations, and properties that every run must have."""
