"""Sensitivity of the friction torque to its parameters."""
