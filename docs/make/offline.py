"""Check that the site loads nothing from a network: python -m docs.make.offline out/site.

Links that a reader clicks may lead anywhere. Scripts, styles, fonts, pictures and frames must not.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

TAG = re.compile(r"<(?:script|img|iframe|source|video|audio|embed|object|link|use)\b[^>]*>", re.IGNORECASE)
SOURCE = re.compile(r"\b(?:src|srcset|href|data|poster|xlink:href)\s*=\s*[\"']?\s*((?:https?:)?//[^\"'\s>]+)")
STYLE = re.compile(r"(?:url\(|@import)\s*[\"']?((?:https?:)?//[^\"')\s]+)", re.IGNORECASE)


def loaded_from_elsewhere(folder: Path) -> Iterator[tuple[Path, str]]:
    """Yield each page or style of a site and each address that a browser would load for it."""
    for path in sorted(folder.rglob("*")):
        if path.suffix not in (".html", ".css", ".svg"):
            continue
        text = path.read_text(encoding="utf-8")
        for tag in TAG.findall(text):
            if 'rel="canonical"' not in tag:
                yield from ((path, address) for address in SOURCE.findall(tag))
        yield from ((path, address) for address in STYLE.findall(text))


def main(folder: Path) -> int:
    """Print what is loaded from elsewhere; return 1 if there is any, or no page at all."""
    pages = list(folder.rglob("*.html"))
    found = list(loaded_from_elsewhere(folder))
    for path, address in found:
        print(f"{path}: loads {address}")
    print(f"{len(pages)} pages, {len(found)} sources elsewhere")
    return int(bool(found) or not pages)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
