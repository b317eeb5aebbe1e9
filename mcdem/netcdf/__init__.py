"""Datasets on disk: whole at every moment, and the log of encounters in few bytes."""
