"""Tangents of a motion through its impacts: how they are carried along a run."""
