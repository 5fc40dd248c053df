"""What each candidate effect, of any size, would do to the data of a fit beyond all that may vary."""
