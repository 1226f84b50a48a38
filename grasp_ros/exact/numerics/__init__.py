"""Polynomials, their roots, and powers of two."""
