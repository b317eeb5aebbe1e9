"""The event-driven Monte Carlo: which aggregates meet next, and what becomes of the population."""
