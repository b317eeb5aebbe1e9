"""Aggregates: primaries and their contacts, size, shape and rigidity."""
