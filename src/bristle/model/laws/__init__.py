"""Friction laws: which peak the level has in slow sliding, and what is added to viscous friction. A file holds one."""
