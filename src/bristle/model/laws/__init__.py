"""Friction laws: the Stribeck peak, and terms beside viscous friction."""
