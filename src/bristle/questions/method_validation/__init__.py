"""How far the grid method is to be trusted at a joint's own design."""
