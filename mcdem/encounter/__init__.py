"""One encounter of two aggregates, from upstream to its outcome."""
