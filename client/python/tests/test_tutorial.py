"""The tutorial's notebook gives what it shows."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import nbformat
import pytest
from conftest import PATIENCE_S, PROGRAMS, ROOT
from nbclient import NotebookClient

NOTEBOOK = ROOT / "docs/tutorial.ipynb"


def words(notebook: Any) -> list[str]:
    """What the cells print or show in words."""
    shown = []
    for output in (it for cell in notebook.cells if cell.cell_type == "code" for it in cell.outputs):
        text = output.get("text") or output.get("data", {}).get("text/plain", "")
        shown.append(text)
    return shown


def test_the_tutorial_gives_what_it_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = nbformat.read(NOTEBOOK, as_version=4)
    (tmp_path / "docs").mkdir()
    (tmp_path / "config").symlink_to(ROOT / "config")
    monkeypatch.setenv("PATH", f"{PROGRAMS}{os.pathsep}{os.environ['PATH']}")
    run = nbformat.read(NOTEBOOK, as_version=4)
    folder = {"metadata": {"path": str(tmp_path / "docs")}}
    # What a cell prints comes in pieces as large as the kernel happens to send them.
    NotebookClient(run, timeout=PATIENCE_S, resources=folder, coalesce_streams=True).execute()
    assert len(words(shown)) > 5 and any("image/svg+xml" in str(cell) for cell in shown.cells)
    assert words(run) == words(shown)
