"""Least squares that knows no friction: linear and nonlinear fits, covariance, bootstrap, comparison of intervals."""
