"""Claims about the toolkit, each with its verdict."""
