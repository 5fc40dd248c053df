"""Parameters fitted to measurements: unknowns, residuals, least squares and uncertainty."""
