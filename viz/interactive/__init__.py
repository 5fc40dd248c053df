"""Figures that turn, zoom and show values: plotly figures made from plain values, for pages and notebooks."""
