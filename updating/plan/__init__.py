"""What a test could see and name before it is made, and tests that see more."""
