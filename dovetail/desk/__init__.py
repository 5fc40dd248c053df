"""The desk: compare, add effects, fit and save by hand, in a browser."""
