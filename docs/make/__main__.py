"""Generate what the pages of docs/ show, and write the site's pages: python -m docs.make out/docs.

The outputs, pictures and tables of each page are generated (`pages`). A page whose own no longer agree with them
(`agreement`, `pictures`) is written anew, so that a checkout shows what the commands print. ``--check`` writes no page and
fails instead. The pages of the site are copies, and each example becomes one with its output and pictures
(`gallery`). As many run at once as there are cores, or as ``--jobs`` states. Pages are first: their commands
take longest.
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


def differences(page: Path, generated: pages.Page, root: Path) -> list[str]:
    """Return what a committed page shows differently from a generated one, as lines; empty if they agree."""
    old, new = page.read_text(encoding="utf-8"), generated.text
    lines = [] if agrees(old, new) else [*unified_diff(old.split("\n"), new.split("\n"), str(page), "generated")]
    for place, content in generated.pictures.items():
        path = root / "docs" / place
        if not path.is_file() or not alike(path.read_bytes(), content):
            lines.append(f"{path}: shows another picture")
    folder = root / "docs" / "images" / page.stem
    unused = {p.relative_to(root / "docs").as_posix() for p in folder.glob("*")} - generated.pictures.keys()
    return lines + [f"{root / 'docs' / place}: no mark of the page has this picture" for place in sorted(unused)]


def write(page: Path, generated: pages.Page, root: Path) -> None:
    """Write a generated page and its pictures in place of the committed ones."""
    page.write_text(generated.text, encoding="utf-8")
    shutil.rmtree(root / "docs" / "images" / page.stem, ignore_errors=True)
    for place, content in generated.pictures.items():
        (root / "docs" / place).parent.mkdir(parents=True, exist_ok=True)
        (root / "docs" / place).write_bytes(content)


def refresh(page: Path, root: Path, store: Store, *, check: bool = False) -> list[str]:
    """Write a page anew where it does not agree with what is generated; return what differed.

    With ``check`` the page stays. With a fresh store it is written even if it agrees.
    """
    generated = pages.generate(page.read_text(encoding="utf-8"), page.name, root, store)
    found = differences(page, generated, root)
    if not check and (found or store.fresh):
        write(page, generated, root)
    return found


def write_site(out: Path, found: Mapping[Path, str], names: list[str]) -> None:
    """Copy all pages and their pictures into a folder as pages of the site."""
    shutil.copytree(
        ROOT / "docs", out, ignore=shutil.ignore_patterns("make", "*.py", "*.md", "__pycache__"), dirs_exist_ok=True
    )
    for source, name in found.items():
        target = out / name
        target.parent.mkdir(parents=True, exist_ok=True)
        text = pages.for_site(source.read_text(encoding="utf-8"), source, ROOT, names)
        target.write_text(text, encoding="utf-8")


def main(options: argparse.Namespace) -> int:
    """Generate all pages or those named, and the site; return 1 if ``--check`` finds a difference."""
    store = Store(CACHE / "results", options.fresh)
    found = pages.sources(ROOT)
    named = [p for p in found if p.is_relative_to(ROOT / "docs") and (not options.page or p.stem in options.page)]
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
    parser.add_argument("out", type=Path, nargs="?", help="folder of the site's pages; its contents are removed")
    parser.add_argument("--page", action="append", default=[], help="generate this page only; repeatable")
    parser.add_argument("--check", action="store_true", help="write no page; fail where one would be written")
    parser.add_argument("--fresh", action="store_true", help="compute all results and write all pages again")
    parser.add_argument("--jobs", type=int, help="number of pages that are computed at once; all cores")
    sys.exit(main(parser.parse_args()))
