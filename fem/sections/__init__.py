"""Cross-sections: shapes, polygons, thin walls and warping."""
