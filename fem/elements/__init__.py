"""Frame elements: their matrices, shape functions and geometric stiffness."""
