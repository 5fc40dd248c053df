"""Pages of docs/: what is generated in them, and their links within the site.

Two things are generated, and a page is committed with both. A block of commands has the output of each:

    ```console examples/first-frame
    $ dovetail modes study.toml
    ```

A mark has what it names below it, up to ``<!-- end -->``:

    <!-- picture examples/first-frame/model.png The model -->    a picture that a command has written
    <!-- file examples/first-frame/study.toml -->    a text file, of the repository or written by a command
    <!-- file examples/missing-card/missing.bdf 12 GRID* -->    twelve lines of it, from the first with GRID*
    <!-- table benchmarks/validation/seeds.csv -->    a table of comma-separated values
    <!-- book textbooks -->    a table of the benchmark book, by the name of its source, or their ``summary``
    <!-- effects kinds -->    a table of what the effects declare, by its name in `docs.make.effects.TABLES`
"""

import csv
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from docs.make.pictures import small
from docs.make.stored import CACHE, NO_STORE, Result, Store, contents, digest, program

COMMANDS = re.compile(r"^```console (\S+)\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
"""Commands that are run in a copy of a folder of the repository, and their output."""

MARK = re.compile(
    r"^<!-- (picture|table|file|book|effects) (.+?) -->\n(?:\n(?:(?!^<!-- ).)*?\n<!-- end -->\n)?",
    re.MULTILINE | re.DOTALL,
)
"""A mark with what is generated below it; a new one has nothing yet."""

GENERATED = re.compile(f"{COMMANDS.pattern}|{MARK.pattern}", re.MULTILINE | re.DOTALL)

LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)#\s]*)(#[^)]*)?\)")

AT_ROOT = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
"""Pages outside docs/, and where the site has them."""


class PageError(RuntimeError):
    """A command of a page that failed, or a file that it did not write."""


def sources(root: Path) -> dict[Path, str]:
    """Return all pages and their names in the site."""
    found = {p: str(p.relative_to(root / "docs")) for p in sorted((root / "docs").rglob("*.md"))}
    return found | {root / name: target for name, target in AT_ROOT.items() if name != "README.md"}


def for_site(text: str, page: Path, root: Path, examples: Collection[str] = ()) -> str:
    """Return a page of the site: links lead to its pages; other files of the repository lose theirs."""
    depth = len(page.parent.relative_to(root / "docs").parts) if page.is_relative_to(root / "docs") else 0

    def link(match: re.Match[str]) -> str:
        words, target, anchor = match[1], match[2], match[3] or ""
        if not target or re.match(r"\w+:", target):
            return match[0]
        path = Path(os.path.normpath(page.parent / target)).relative_to(root)
        if path.parts[0] == "docs":
            where = path.relative_to("docs").as_posix()
        elif str(path) in AT_ROOT:
            where = AT_ROOT[str(path)]
        elif str(path) == "examples":
            where = "gallery/index.md"
        elif path.parts[0] == "examples" and path.stem in examples:
            where = f"gallery/{path.stem}.md"
        else:
            return words if words.startswith("`") else f"`{path}`" if words == target else words
        return f"[{words}]({'../' * depth}{where}{anchor})"

    # the highlighter of the site takes no second word
    return COMMANDS.sub(r"```console\n\2```\n", LINK.sub(link, text))


@dataclass(frozen=True, slots=True)
class Page:
    """The text of a page and its generated pictures, by their places below docs/."""

    text: str
    pictures: Mapping[str, bytes]


def generate(text: str, name: str, root: Path, store: Store = NO_STORE) -> Page:
    """Return a page whose outputs, pictures and tables are generated anew.

    Commands run in a copy of their folder, so that the repository stays as it is. Stored results are not
    computed again.

    Raises
    ------
    PageError
        If a command fails, or has not written a picture or a file.
    """
    pictures: dict[str, bytes] = {}
    with TemporaryDirectory() as temporary:
        work = Path(temporary)

        def copied(folder: str) -> Path:
            if not (work / folder).exists():
                shutil.copytree(
                    root / folder, work / folder, ignore=shutil.ignore_patterns("__pycache__", ".*.desk.*")
                )
            return work / folder

        def picture(argument: str) -> str:
            path, _, words = argument.partition(" ")
            if not (work / path).is_file():
                msg = f"{name}: no command has written {path}"
                raise PageError(msg)
            place = f"images/{Path(name).stem}/{Path(path).name}"
            pictures[place] = small((work / path).read_bytes())
            return f"![{words}]({place})"

        def file(argument: str) -> str:
            path, _, part = argument.partition(" ")
            return listing(work / path if (work / path).is_file() else root / path, part)

        fillers: Mapping[str, Callable[[str], str]] = {
            "picture": picture,
            "file": file,
            "table": lambda argument: table(root / argument),
            "book": lambda argument: book_table(argument, store),
            "effects": effects_table,
        }

        def filled(match: re.Match[str]) -> str:
            folder, commands, kind, argument = match.groups()
            if folder:
                return f"```console {folder}\n" + "".join(outputs(commands, copied(folder), store)) + "```\n"
            return f"<!-- {kind} {argument} -->\n\n{fillers[kind](argument)}\n\n<!-- end -->\n"

        return Page(GENERATED.sub(filled, text), pictures)


def environment_of(root: Path, **more: str) -> dict[str, str]:
    """Return the environment of a process that imports the packages of a checkout."""
    paths = os.pathsep.join([str(root), os.environ.get("PYTHONPATH", "")])
    if sys.dont_write_bytecode:  # else each of forty processes would compile all modules
        more |= {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(CACHE / "bytecode")}
    return {**os.environ, "PYTHONPATH": paths, **more}


def outputs(text: str, folder: Path, store: Store) -> Iterator[str]:
    """Run the lines of a block that begin with ``$``; yield each with its output, in place of other lines."""
    for line in text.splitlines():
        if not line.startswith("$ "):
            continue
        # a command may read what those before it have written
        key = line, digest(repr(contents(folder))), program()
        result = store.result(key, lambda line=line: run(line, folder))
        result.write_files(folder)
        yield f"{line}\n{result.text}\n" if result.text else f"{line}\n"


def run(line: str, folder: Path) -> Result:
    """Run a line that begins with ``$`` in a folder; return its output and the files that it has written.

    Raises
    ------
    PageError
        If the command fails.
    """
    words = shlex.split(line[2:])
    interpreter = [sys.executable, *(["-m", "dovetail"] if words[0] == "dovetail" else [])]
    before = contents(folder)
    done = subprocess.run(
        [*interpreter, *words[1:]],
        cwd=folder,
        env=environment_of(Path(__file__).parents[2]),
        capture_output=True,
        text=True,
    )
    if done.returncode:
        msg = f"{line}: exit code {done.returncode}\n{done.stdout}{done.stderr}"
        raise PageError(msg)
    written = [name for name, hashed in contents(folder).items() if before.get(name) != hashed]
    text = "\n".join(row.rstrip() for row in done.stdout.rstrip().splitlines())
    return Result(text, {name: (folder / name).read_bytes() for name in written})


def table(path: Path) -> str:
    """Return comma-separated values as a table."""
    with path.open(encoding="utf-8", newline="") as file:
        head, *rows = list(csv.reader(file))
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('_', ' ') for cell in row)} |" for row in lines)


def book_table(name: str, store: Store) -> str:
    """Return a table of the benchmark book, by the name of its source, or the ``summary`` of all."""

    def computed() -> Result:
        from docs.make import book  # it computes with all packages; other pages need none

        return Result(book.summary() if name == "summary" else book.table(name))

    return store.result(("book", name, program(book=True)), computed).text


def effects_table(name: str) -> str:
    """Return a table of what the effects declare, by its name in `docs.make.effects.TABLES`."""
    from docs.make.effects import TABLES

    return TABLES[name]().rstrip("\n")


def listing(path: Path, part: str = "") -> str:
    """Return a text file as a block of code, or a part of it.

    Such as ``12 GRID*``: twelve lines, from the first with GRID* on.
    """
    language = {".toml": "toml", ".py": "python"}.get(path.suffix, "text")
    lines = path.read_text(encoding="utf-8").rstrip().split("\n")
    if part:
        n, _, text = part.partition(" ")
        first = next(k for k, line in enumerate(lines) if text in line)
        lines = lines[first : first + int(n)]
    return "\n".join([f"```{language}", *lines, "```"])
