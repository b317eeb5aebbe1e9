"""Datasets on disk: whole at every moment, and compared bit by bit."""
