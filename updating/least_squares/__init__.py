"""Nonlinear least squares: one loop for all fits, and the robust loss of residuals."""
