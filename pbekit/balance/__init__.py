"""The population balance in event form: grid, encounters, daughters, right-hand side."""
