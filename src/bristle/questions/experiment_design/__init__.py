"""Design of the next measurements of a joint."""
