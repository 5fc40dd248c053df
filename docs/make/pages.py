"""Pages of the site: links that lead within it, output of commands, pictures and tables."""

import csv
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Collection, Iterator
from pathlib import Path

from docs.make.stored import CACHE, NO_STORE, Result, Store, contents, digest, program

COMMANDS = re.compile(r"^```console (\S+)\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
"""Commands that are run in a folder of the repository, or a copy of it: ```console examples/first-frame."""

PICTURE = re.compile(r"^<!-- picture (\S+) (.*?) -->$", re.MULTILINE)
"""A picture that a command has written: <!-- picture examples/first-frame/report/x.png What it shows. -->"""

TABLE = re.compile(r"^<!-- table (\S+) -->$", re.MULTILINE)
"""A table of comma-separated values: <!-- table benchmarks/validation/seeds.csv -->"""

FILE = re.compile(r"^<!-- file (\S+) -->$", re.MULTILINE)
"""A text file, of the repository or written by a command: <!-- file examples/first-frame/study.toml -->"""

BOOK = re.compile(r"^<!-- book (\w+) -->$", re.MULTILINE)
"""A table of the benchmark book, by the name of its source, or ``summary``."""

LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)#\s]*)(#[^)]*)?\)")

AT_ROOT = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
"""Pages outside docs/, and where the site has them."""


class PageError(RuntimeError):
    """A command of a page that failed, or a file that it did not write."""


def sources(root: Path) -> dict[Path, str]:
    """Return all pages and their names in the site."""
    found = {p: str(p.relative_to(root / "docs")) for p in sorted((root / "docs").rglob("*.md"))}
    return found | {root / name: target for name, target in AT_ROOT.items() if name != "README.md"}


def with_site_links(text: str, page: Path, root: Path, examples: Collection[str] = ()) -> str:
    """Return a page whose links lead to pages of the site; other files of the repository lose theirs."""
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

    return LINK.sub(link, text)


def expand(text: str, target: Path, root: Path, store: Store = NO_STORE) -> str:
    """Return a page with the output of its commands, its pictures and its tables in it.

    Commands run in a copy of their folder beside the page, so that the repository stays as it is. Stored
    results are not computed again.
    """
    work = target.with_suffix("")

    def copied(name: str) -> Path:
        folder = work / "_run" / name
        if not folder.exists():
            shutil.copytree(root / name, folder, ignore=shutil.ignore_patterns("__pycache__"))
        return folder

    def commands(match: re.Match[str]) -> str:
        return "```console\n" + "".join(outputs(match[2], copied(match[1]), store)) + "```\n"

    def picture(match: re.Match[str]) -> str:
        source = work / "_run" / match[1]
        if not source.is_file():
            msg = f"{target.name}: no command has written {match[1]}"
            raise PageError(msg)
        shutil.copy(source, work / source.name)
        return f"![{match[2]}]({work.name}/{source.name})"

    def file(match: re.Match[str]) -> str:
        written = work / "_run" / match[1]
        return listing(written if written.is_file() else root / match[1])

    text = COMMANDS.sub(commands, text)
    text = PICTURE.sub(picture, text)
    text = TABLE.sub(lambda match: table(root / match[1]), text)
    text = FILE.sub(file, text)
    text = BOOK.sub(lambda match: shelved(match[1], store), text)
    shutil.rmtree(work / "_run", ignore_errors=True)
    return text


def environment_of(root: Path, **more: str) -> dict[str, str]:
    """Return the environment of a process that imports the packages of a checkout."""
    paths = os.pathsep.join([str(root), os.environ.get("PYTHONPATH", "")])
    if sys.dont_write_bytecode:  # else each of forty processes would compile all modules
        more |= {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(CACHE / "bytecode")}
    return {**os.environ, "PYTHONPATH": paths, **more}


def outputs(text: str, folder: Path, store: Store) -> Iterator[str]:
    """Run the lines of a block that begin with ``$``; yield each with its output."""
    for line in text.splitlines():
        if not line.startswith("$ "):
            yield f"{line}\n"
            continue
        # a command may read what those before it have written
        key = line, digest(repr(contents(folder))), program()
        result = store.result(key, lambda line=line: run(line, folder))
        result.write_files(folder)
        yield f"{line}\n{result.text}\n"


def run(line: str, folder: Path) -> Result:
    """Run a line that begins with ``$`` in a folder; return its output and the files that it has written.

    Raises
    ------
    PageError
        If the command fails.
    """
    words = line[2:].split()
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
    return Result(done.stdout.rstrip(), {name: (folder / name).read_bytes() for name in written})


def table(path: Path) -> str:
    """Return comma-separated values as a table."""
    with path.open(encoding="utf-8", newline="") as file:
        head, *rows = list(csv.reader(file))
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('_', ' ') for cell in row)} |" for row in lines)


def shelved(name: str, store: Store) -> str:
    """Return a table of the benchmark book."""

    def computed() -> Result:
        from docs.make import book  # it computes with all packages; other pages need none

        return Result(book.summary() if name == "summary" else book.table(name))

    return store.result(("book", name, program(book=True)), computed).text


def listing(path: Path) -> str:
    """Return a text file as a block of code."""
    language = {".toml": "toml", ".py": "python"}.get(path.suffix, "text")
    return f"```{language}\n{path.read_text(encoding='utf-8').rstrip()}\n```"
