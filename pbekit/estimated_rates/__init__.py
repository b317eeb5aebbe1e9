"""Rates of aggregation, breakup and restructuring estimated from tables of encounters."""
