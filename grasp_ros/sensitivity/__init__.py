"""Derivatives of a motion through its impacts, and what they are for."""
