"""The pages of the book, and what they link to, in folders as in the project, so that every link means
the same.

usage: book_pages.py FOLDER   run in the project's root
"""

import json
import re
import shutil
import sys
from pathlib import Path

TAKEN = ["*.md", "LICENSE-*", "docs/**/*", "client/README.md", "client/examples/*", "client/include/*",
         "config/dynocar.service", "config/dynocar-flight-recorder.service", "config/daemon.toml",
         "config/live/foxglove_layout.json", "config/live/plotjuggler_layout.xml",
         "config/live/grafana_dashboard.json", "config/live/prometheus_alerts.yml",
         "config/live/telegraf.conf"]


def fenced(language: str, text: str) -> str:
    return f"```{language}\n{text.rstrip()}\n```"


def shown(output: dict) -> str:
    """An output of a notebook: a picture or table as it is, else its text."""
    if output["output_type"] == "stream":
        return fenced("text", "".join(output["text"]))
    for kind in ("image/svg+xml", "text/html"):
        if kind in output["data"]:
            return f"<div>{''.join(output['data'][kind])}</div>"
    return fenced("text", "".join(output["data"]["text/plain"]))


def page_of_notebook(place: Path) -> str:
    parts = []
    for cell in json.loads(place.read_text())["cells"]:
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else fenced("python", source))
        parts += [shown(output) for output in cell.get("outputs", [])]
    parts.insert(1, f"This page is <a href=\"{place.name}\">a notebook</a>.")
    return "\n\n".join(parts)


def as_mkdocs_reads_it(text: str) -> str:
    """A list right after a paragraph, a bar in the code of a table and notebooks are other to MkDocs."""
    lines, before, is_code = [], "", False
    for line in text.splitlines():
        is_code ^= line.startswith("```")
        if not is_code:
            is_list = re.match(r"- |1\. ", line)
            if is_list and before and not re.match(r"- |\d+\. |  |#", before):
                lines.append("")
            line = line.replace(r"\|", "|") if line.startswith("|") else line
            line = line.replace(".ipynb)", ".md)")
        lines.append(line)
        before = line
    return "\n".join(lines) + "\n"


folder = Path(sys.argv[1])
shutil.rmtree(folder, ignore_errors=True)
for path in sorted(path for pattern in TAKEN for path in Path().glob(pattern) if path.is_file()):
    place = folder / path
    place.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(path, place)
    if path.suffix == ".md":
        place.write_text(as_mkdocs_reads_it(path.read_text()))
    elif path.suffix == ".ipynb":
        place.with_suffix(".md").write_text(as_mkdocs_reads_it(page_of_notebook(path)))
