"""Complex noise of simulated measurements."""


def complex_normal(rng, shape):
    """Return an array of a shape whose real and imaginary parts are standard normal."""
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
