"""The exact two-sphere problem: series, far field, tables, and pair lubrication made of them."""
