"""Shapes and colours of the markers that effects name."""

from viz import style

SHAPES = {
    "circle": "o",
    "cross": "X",
    "diamond": "D",
    "dot": ".",
    "hexagon": "h",
    "hexagon_flat": "H",
    "octagon": "8",
    "plus": "P",
    "square": "s",
    "star": "*",
    "thin_diamond": "d",
    "triangle": "^",
    "triangle_down": "v",
}
"""Matplotlib's letters of the shapes that effects name."""

COLOURS = {
    "green": style.GREEN,
    "joint": style.JOINT,
    "orange": style.ORANGE,
    "purple": style.PURPLE,
    "sky": style.SKY,
    "support": style.SUPPORT,
    "vermilion": style.VERMILION,
}
"""The colours that effects name."""

OTHER_MARKERS = ("p", "*", "<", ">", "d", "8")
"""Shapes of kinds that name none, in turn."""
