"""Accidents on purpose: faults of a graph, damaged files, random scenes, random calls."""
