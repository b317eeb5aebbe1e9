"""What a dataset says: statistics, breakup, the paper's numbers, accuracy against cost, sensitivity."""
