"""Pictures of the pages: small files, and whether two show the same."""

from io import BytesIO

import numpy as np
from PIL import Image

WIDTH = 1400
"""Largest width [pixels]: twice that of a page's text on a screen."""

COLOURS = 256

THUMBNAIL = (48, 36)
SAME_GREY = 0.02
"""Largest rms difference of the thumbnails of two pictures that show the same, of full scale.

Another renderer smooths edges differently, which changes less; a moved curve or another colour changes more.
"""


def small(content: bytes) -> bytes:
    """Return a picture as a PNG file of limited width with few colours."""
    picture = Image.open(BytesIO(content)).convert("RGB")
    if picture.width > WIDTH:
        size = WIDTH, round(picture.height * WIDTH / picture.width)
        picture = picture.resize(size, Image.Resampling.LANCZOS)
    written = BytesIO()
    picture.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(
        written, "png", optimize=True
    )
    return written.getvalue()


def alike(one: bytes, other: bytes) -> bool:
    """Return whether two pictures show the same, apart from how edges are smoothed."""
    pictures = [Image.open(BytesIO(content)).convert("RGB") for content in (one, other)]
    if pictures[0].size != pictures[1].size:
        return False
    a, b = (np.asarray(p.resize(THUMBNAIL, Image.Resampling.BOX), float) / 255.0 for p in pictures)
    return float(np.sqrt(((a - b) ** 2).mean())) <= SAME_GREY
