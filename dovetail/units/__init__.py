"""Work on many units that do not need one another: cases, samples, tested structures."""
