"""The balance over time, at steady state, and for a finite population."""
