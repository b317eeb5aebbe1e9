"""Slow and obvious ways to what the toolkit computes fast: closed series, library integrators, point forces."""
