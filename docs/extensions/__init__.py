"""What the manual needs of Sphinx beyond what Sphinx has: one part a file."""
