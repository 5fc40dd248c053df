"""The gallery: each example with its output and the pictures that it draws."""

import ast
import subprocess
import sys
from collections.abc import Iterable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from docs.make import notebooks
from docs.make.pages import PageError, environment_of
from docs.make.stored import NO_STORE, Result, Store, contents, digest, first_package, program

HEAD = """\
---
hide:
  - toc # more room for the cards
---

# Gallery

Each example is a script of fewer than 60 lines, or a notebook, and ends in an assertion on a number: a closed
form, a published value, or the truth that was hidden. Its last line of output is below its title. Outputs and
pictures are those of this build.
"""

GROUPS = {
    "Frames": range(10, 20),
    "FRFs and modes": (*range(20, 30), *range(60, 80)),
    "Joints": range(50, 60),
    "Compare and find": (*range(30, 50), *range(80, 90)),
    "Update": range(90, 95),
    "Many structures": range(95, 100),
}
"""Headings of the index, and the first two digits of the examples below each."""

PICTURE = 'loading="lazy" style="width: 100%; height: 12em; object-fit: contain; background: white"'
"""Attributes that make pictures of all shapes equally large on the cards."""

STUDIES = """
## Studies

The folder `examples` has larger studies as well:

| folder | shows |
|---|---|
| `cross-beam` | a study with mesh file, universal file and an elastic joint; `make demo` runs it |
| `first-frame` | the study of the [tutorial](../first-frame.md) |
| `missing-card` | a Nastran deck and a test, and [the card that was missing](../missing-card.md) |
| `loaded-portal` | a study of [statics](../statics.md) and of [loads and time](../loads-and-time.md) |
| `fan` | a study of [rotors](../rotors.md) |
| `tuned-absorber` | a planar mast with a tuned absorber, one and many |
| `joint-study` | the numerical and the experimental study of the cross-beam paper, with their pictures |
| `southampton-frame` | a study of a measured frame |
| `garteur`, `three-storeys`, `four-storeys`, `eighteen-storeys` | [measured modes](../measured-frames.md) |
"""


@dataclass(frozen=True, slots=True)
class Example:
    """A script, its output, and its pictures, which lie beside its page."""

    name: str
    title: str
    text: str
    code: str
    output: str
    pictures: tuple[str, ...]


def sources(examples: Path) -> list[Path]:
    """Return all notebooks and scripts of the gallery."""
    return [*sorted(examples.glob("[0-9]*.ipynb")), *sorted(examples.glob("[0-9]*.py"))]


def write(paths: Iterable[Path], out: Path, pool: Executor, store: Store = NO_STORE) -> Future[None]:
    """Run examples and notebooks, write their pages and, when all are there, the index."""
    out.mkdir(parents=True)
    shown = [pool.submit(shown_by, path, out, store) for path in paths]
    return pool.submit(lambda: _write_index([one.result() for one in shown], out))


def shown_by(path: Path, out: Path, store: Store) -> Example:
    """Run an example or a notebook and write its page."""
    if path.suffix == ".ipynb":
        example = told_notebook(path, out, store)
    else:
        example = run(path, out, store)
        (out / f"{example.name}.md").write_text(page(example), encoding="utf-8")
    print(path.name, flush=True)
    return example


def told_notebook(path: Path, out: Path, store: Store) -> Example:
    """Run a notebook and write its page, and beside it the library that draws its figures."""
    text = path.read_text(encoding="utf-8")
    key = path.name, text, data_of(path), program()
    page = store.result(key, lambda: Result(notebooks.page(notebooks.executed(path), path.stem))).text
    (out / f"{path.stem}.md").write_text(page, encoding="utf-8")
    (out / notebooks.SCRIPT).write_text(notebooks.script(), encoding="utf-8")
    return Example(path.stem, notebooks.title_of(page), "", "", "", ())


def data_of(path: Path) -> str:
    """Return a hash of what lies beside an example, without the other examples."""
    files = contents(path.parent)
    return digest(*(f"{name} {hashed}" for name, hashed in files.items() if not name[0].isdigit()))


def run(path: Path, out: Path, store: Store = NO_STORE) -> Example:
    """Run an example, or take its result from the store; its pictures go to ``out``."""
    code = path.read_text(encoding="utf-8")
    module = ast.parse(code)
    title, _, text = (ast.get_docstring(module) or path.stem).partition("\n")
    body = "\n".join(code.splitlines()[module.body[0].end_lineno :]).strip()
    key = path.name, code, data_of(path), program(first_package(code))
    result = store.result(key, lambda: output_of(path))
    result.write_files(out)
    return Example(path.stem, title.rstrip("."), text.strip(), body, result.text, tuple(result.files))


def output_of(path: Path) -> Result:
    """Run an example; return its output and the pictures, which it writes to a temporary folder.

    Raises
    ------
    PageError
        If it fails.
    """
    with TemporaryDirectory() as folder:
        environment = environment_of(path.parents[1], TMPDIR=folder)
        done = subprocess.run([sys.executable, path], env=environment, capture_output=True, text=True)
        if done.returncode:
            msg = f"{path.name}: exit code {done.returncode}\n{done.stderr}"
            raise PageError(msg)
        output = done.stdout
        pictures = {}
        for picture in sorted(Path(folder).rglob("*.png")):
            output = output.replace(str(picture), picture.name).replace(str(picture.parent), "a folder")
            pictures[f"{path.stem}-{picture.name}"] = picture.read_bytes()
    return Result(output.rstrip(), pictures)


def page(example: Example) -> str:
    """Return the page of an example."""
    shown = "".join(f"![{_words(p, example)}]({p})\n\n" for p in example.pictures)
    output = f"```text\n{example.output}\n```\n\n" if example.output else ""
    text = f"{example.text}\n\n" if example.text else ""
    return (
        f"# {example.title}\n\n{text}{shown}{output}"
        f"`examples/{example.name}.py`:\n\n```python\n{example.code}\n```\n"
    )


def _write_index(examples: list[Example], out: Path) -> None:
    (out / "index.md").write_text(index(examples), encoding="utf-8")


def index(examples: list[Example]) -> str:
    """Return the page of all examples: a card for each, with its picture first, below the headings."""
    text = HEAD
    for heading, numbers in GROUPS.items():
        cards = [card(e) for e in sorted(examples, key=lambda e: e.name) if int(e.name[:2]) in numbers]
        if cards:
            text += f'\n## {heading}\n\n<div class="grid cards" markdown>\n\n{"".join(cards)}</div>\n'
    return text + STUDIES


def card(example: Example) -> str:
    """Return the card of an example: its picture, its title up to a colon and the last line of its output."""
    link = f"{example.name}.md"
    parts = [f"**[{example.title.partition(':')[0]}]({link})**"]
    if example.pictures:
        parts.insert(0, f"[![]({example.pictures[0]}){{ {PICTURE} }}]({link})")
    if example.output:
        parts.append(f"`{example.output.splitlines()[-1]}`")
    return "-   " + "\n\n    ".join(parts) + "\n\n"


def _words(picture: str, example: Example) -> str:
    return Path(picture).stem.removeprefix(f"{example.name}-").replace("-", " ")
