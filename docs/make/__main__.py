"""Write the pages that MkDocs turns into the site: python -m docs.make out/docs.

Pages of docs/ are copied. Their commands are run, and their output and pictures are put in (`pages`). Each
example becomes a page with its output and pictures (`gallery`). As many run at once as there are cores, or
as ``--jobs`` states. Pages are first: their commands take longest.
Results of an earlier build are used again where nothing that they depend on has changed (`stored`).
"""

import argparse
import os
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from docs.make import gallery, pages
from docs.make.stored import CACHE, Store

ROOT = Path(__file__).parents[2]


def main(out: Path, store: Store, jobs: int | None = None) -> None:
    """Write all pages into a folder, so many at once; its earlier contents are removed."""
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(ROOT / "docs", out, ignore=shutil.ignore_patterns("make", "*.py", "*.md", "__pycache__"))
    examples = gallery.sources(ROOT / "examples")
    names = [path.stem for path in examples]

    def write(source: Path, name: str) -> None:
        target = out / name
        target.parent.mkdir(parents=True, exist_ok=True)
        text = pages.with_site_links(source.read_text(encoding="utf-8"), source, ROOT, names)
        target.write_text(pages.expand(text, target, ROOT, store), encoding="utf-8")
        print(name, flush=True)

    with ThreadPoolExecutor(jobs or os.cpu_count()) as pool:
        written = [pool.submit(write, source, name) for source, name in pages.sources(ROOT).items()]
        shown = gallery.write(examples, out / "gallery", pool, store)
        for one in (shown, *written):
            one.result()
    store.remove_unused()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m docs.make", description="Write the pages of the site.")
    parser.add_argument("out", type=Path, help="folder of the pages; its earlier contents are removed")
    parser.add_argument("--fresh", action="store_true", help="compute all results again")
    parser.add_argument("--jobs", type=int, help="number of pages that are computed at once; all cores")
    options = parser.parse_args()
    main(options.out, Store(CACHE / "results", options.fresh), options.jobs)
