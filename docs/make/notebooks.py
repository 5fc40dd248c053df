"""Notebooks of the gallery as pages: run when the site is built, with tables, pictures and live figures."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from docs.make.pages import PageError, environment_of

PLOTLY = "application/vnd.plotly.v1+json"
SCRIPT = "plotly.min.js"
"""The drawing library, which lies beside the pages of the gallery."""
SECONDS = 900
"""A cell that takes longer is taken for hanging."""


def executed(path: Path) -> Any:
    """Return a notebook with its outputs; the file stays as it is.

    Raises
    ------
    PageError
        If a cell fails.
    """
    import nbformat
    from nbclient import NotebookClient
    from nbclient.exceptions import CellExecutionError

    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(
        notebook, timeout=SECONDS, kernel_name="python3", extra_arguments=["--log-level=ERROR"],
        resources={"metadata": {"path": str(path.parent)}},
    )  # fmt: skip
    # figures are left to the page
    environment = environment_of(path.parents[1], PLOTLY_RENDERER="plotly_mimetype")
    try:
        return client.execute(env=environment)
    except CellExecutionError as reason:
        msg = f"{path.name}: a cell ends with {reason.ename}: {reason.evalue}"
        raise PageError(msg) from reason


def title_of(page: str) -> str:
    """Return the heading of a notebook's page."""
    return page.partition("\n")[0].removeprefix("# ")


def page(notebook: Any, name: str) -> str:
    """Return a notebook as a page: text, code, and outputs below it."""
    parts, n = [], 0
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        for output in joined(cell.outputs):
            n += 1
            parts.append(shown(output, f"figure-{n}"))
    parts.append(f"This page is `examples/{name}.ipynb`, run when the site was built.")
    live = any('class="figure"' in part for part in parts)
    script = f'<script src="{SCRIPT}"></script>\n\n' if live else ""
    head, _, rest = "\n\n".join(filter(None, parts)).partition("\n")
    return f"{head}\n\n{script}{rest.lstrip()}\n"


def joined(outputs: Iterable[Any]) -> list[Any]:
    """Return outputs with printed text that comes in several parts as one."""
    out: list[Any] = []
    for output in outputs:
        if out and output.output_type == "stream" == out[-1].output_type and output.name == out[-1].name:
            out[-1] = type(output)(output, text=out[-1].text + output.text)
        else:
            out.append(output)
    return out


def shown(output: Any, name: str) -> str:
    """Return an output as Markdown: a live figure, HTML, or text; the richest form that it has."""
    if output.output_type == "stream":
        return f"```text\n{output.text.rstrip()}\n```"
    data = output.get("data", {})
    if PLOTLY in data:
        return _figure(data[PLOTLY], name)
    if "text/html" in data:
        return f'<div class="output" markdown="0">\n{_without_empty_lines(data["text/html"])}\n</div>'
    return f"```text\n{data['text/plain'].rstrip()}\n```" if "text/plain" in data else ""


def _figure(figure: Any, name: str) -> str:
    """Return a figure of plotly as an element and the script that draws it."""
    height = figure["layout"].get("height", 450)
    # a closing tag inside of a text would end the script
    parts = (json.dumps(figure[key], ensure_ascii=True).replace("<", "\\u003c") for key in ("data", "layout"))
    data, layout = parts
    options = '{"responsive": true, "displaylogo": false}'
    return (
        f'<div class="figure" id="{name}" markdown="0" style="height:{height}px;background:#fff"></div>\n'
        f'<script>Plotly.newPlot("{name}", {data}, {layout}, {options})</script>'
    )


def _without_empty_lines(text: str) -> str:
    """Return HTML that Markdown takes for one block."""
    return "\n".join(line for line in text.splitlines() if line.strip())


def script() -> str:
    """Return the drawing library."""
    from plotly.offline import get_plotlyjs

    return get_plotlyjs()
