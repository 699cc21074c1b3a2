"""Fits of arrays: velocity and torque in, parameters with their intervals out, by the names that users of SciPy and pandas know."""
