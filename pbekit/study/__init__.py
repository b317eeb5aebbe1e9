"""Comparison with Monte Carlo and analytical laws, ablation, uncertainty, dependence on stress."""
