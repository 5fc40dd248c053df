"""Put two pictures of `make demo` beside each other: python docs/images/demo.py out/demo/pictures."""

import sys
from pathlib import Path

from PIL import Image

folder = Path(sys.argv[1])
pictures = [Image.open(folder / name).convert("RGB") for name in ("structure.png", "staircase.png")]
height = 480
parts = [p.resize((round(p.width * height / p.height), height), Image.LANCZOS) for p in pictures]
page = Image.new("RGB", (sum(p.width for p in parts) + 20, height), "white")
page.paste(parts[0], (0, 0))
page.paste(parts[1], (parts[0].width + 20, 0))
page.quantize(128, dither=Image.Dither.NONE).save(Path(__file__).with_name("demo.png"), optimize=True)
