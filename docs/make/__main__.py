"""Generate what the pages of docs/ show, and write the site's pages: python -m docs.make out/docs.

The outputs, pictures and tables of each page are generated (`pages`). A page that does not agree with them
(`agreement`, `pictures`) is written anew, so that a checkout shows what the commands print. ``--check``
writes none and fails instead. The pages of the site are copies, and each example becomes one with its output
and pictures (`gallery`). As many run at once as there are cores, or as ``--jobs`` states. Pages are first:
their commands take longest.
Results of an earlier run are used again where nothing that they depend on has changed (`stored`).
"""

import argparse
import os
import shutil
import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from difflib import unified_diff
from pathlib import Path

from docs.make import gallery, pages
from docs.make.agreement import agrees
from docs.make.pictures import alike
from docs.make.stored import CACHE, Store

ROOT = Path(__file__).parents[2]


def refresh(page: Path, root: Path, store: Store, *, check: bool = False) -> list[str]:
    """Write a page and its pictures anew where they are not as generated; return what differed.

    With ``check`` nothing is written. With a fresh store everything is.
    """
    old = page.read_text(encoding="utf-8")
    made, found = pages.generate(old, page.name, root, store), []
    if not (same := agrees(old, made.text)):
        found += unified_diff(old.split("\n"), made.text.split("\n"), str(page), "generated", lineterm="")
    if not check and (store.fresh or not same):
        page.write_text(made.text, encoding="utf-8")
    pictures = {root / "docs" / place: content for place, content in made.pictures.items()}
    for path, content in pictures.items():
        if not (same := path.is_file() and alike(path.read_bytes(), content)):
            found.append(f"{path}: shows another picture")
        if not check and (store.fresh or not same):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
    for path in sorted({*(root / "docs" / "images" / page.stem).glob("*")} - pictures.keys()):
        found.append(f"{path}: no mark of the page has this picture")
        if not check:
            path.unlink()
    return found


def write_site(out: Path, found: Mapping[Path, str], names: list[str]) -> None:
    """Copy all pages and their pictures into a folder as pages of the site."""
    sources = shutil.ignore_patterns("make", "*.py", "*.md", "__pycache__")
    shutil.copytree(ROOT / "docs", out, ignore=sources, dirs_exist_ok=True)
    for source, name in found.items():
        target = out / name
        target.parent.mkdir(parents=True, exist_ok=True)
        text = pages.for_site(source.read_text(encoding="utf-8"), source, ROOT, names)
        target.write_text(text, encoding="utf-8")


def main(options: argparse.Namespace) -> int:
    """Generate all pages or those named, and the site; return 1 if ``--check`` finds a difference."""
    store = Store(CACHE / "results", options.fresh)
    found = pages.sources(ROOT)
    named = [p for p in found if p.is_relative_to(ROOT / "docs") and p.stem in (options.page or [p.stem])]
    examples = gallery.sources(ROOT / "examples")

    def refreshed(page: Path) -> list[str]:
        lines = refresh(page, ROOT, store, check=options.check)
        print("\n".join([f"{page.relative_to(ROOT)}{': differs' if lines else ''}", *lines]), flush=True)
        return lines

    with ThreadPoolExecutor(options.jobs or os.cpu_count()) as pool:
        changed = [pool.submit(refreshed, page) for page in named]
        if options.out:
            shutil.rmtree(options.out, ignore_errors=True)
            gallery.write(examples, options.out / "gallery", pool, store).result()
        differ = [one.result() for one in changed]
    if options.out:
        write_site(options.out, found, [path.stem for path in examples])
        store.remove_unused()
    return int(options.check and any(differ))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m docs.make", description="Generate the pages of docs/.")
    parser.add_argument("out", type=Path, nargs="?", help="folder of the site's pages; emptied first")
    parser.add_argument("--page", action="append", default=[], help="generate this page only; repeatable")
    parser.add_argument("--check", action="store_true", help="write no page; fail where one would be written")
    parser.add_argument("--fresh", action="store_true", help="compute all results and write all pages again")
    parser.add_argument("--jobs", type=int, help="number of pages that are computed at once; all cores")
    sys.exit(main(parser.parse_args()))
