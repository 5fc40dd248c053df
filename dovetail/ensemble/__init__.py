"""Monte Carlo of a study's uncertain parameters: bands of natural frequencies and FRFs."""
