"""What docs/walkthrough.md adds, done: its blocks of code in a copy of the sources, which is built and run.

Each section says how many files its change takes; so many differ, and beside them only those that are written from the
Rust types. It fails when a block finds its place no more.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = "docs/walkthrough.md"
PLACE = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve() / "growth"
# Its own folder, and no more optimised than pays.
BUILD = {
    "CARGO_TARGET_DIR": str(PLACE / "target"),
    "CARGO_PROFILE_DEV_OPT_LEVEL": "0",
    "CARGO_PROFILE_DEV_CODEGEN_UNITS": "8",
    "CARGO_PROFILE_DEV_DEBUG": "none",
    "CARGO_INCREMENTAL": "0",
    "DYNOCAR_WRITE_BINDINGS": "1",
}
# Written from the Rust types, by tests that otherwise compare; with what is added.
WRITTEN = {"client/include/dynocar.h", "client/python/dynocar/_vocabulary.py"}
ADDED = ["IDLE_DRAG", "MASS_IMPULSE", "HEADWIND"]
BLOCK = re.compile(r"```\w+\n(?:// )?(\S+), (new|after|before|last in|in place of)(?:: ([^\n]*))?\n(.*?)```", re.DOTALL)


def grown(text: str, how: str, mark: str) -> tuple[int, int]:
    """The lines that a block takes the place of, by where the only line that begins with the mark stands."""
    lines = text.splitlines()
    found = [at for at, line in enumerate(lines) if line.strip().startswith(mark)]
    if len(found) != 1:
        sys.exit(f"{PAGE}: {len(found)} lines begin with {mark!r}, expected one")
    at = found[0]
    if how == "last in":
        # The end of what begins there stands as far from the margin.
        margin = len(lines[at]) - len(lines[at].lstrip())
        at = next(k for k in range(at + 1, len(lines)) if lines[k][: margin + 1].strip())
        return at, at
    return (at + (how == "after"), at + (how != "before"))


def apply(section: str, copy: Path) -> set[str]:
    """Applies the blocks of a section; gives the files that it changes."""
    changed = set()
    blocks = BLOCK.findall(section)
    if 2 * len(blocks) != section.count("```"):
        sys.exit(f"{PAGE}: a block does not say where it belongs")
    for name, how, mark, code in blocks:
        path = copy / name
        if how == "new":
            if path.exists():
                sys.exit(f"{PAGE}: {name} is there already")
            path.write_text(code)
        else:
            text = path.read_text()
            start, end = grown(text, how, mark)
            lines = text.splitlines(keepends=True)
            path.write_text("".join([*lines[:start], code, *lines[end:]]))
        changed.add(name)
    return changed


def main() -> None:
    sections = {it.split("\n", 1)[0]: it for it in (ROOT / PAGE).read_text().split("\n### ")[1:]}
    copy = PLACE / "sources"
    shutil.rmtree(copy, ignore_errors=True)
    tracked = subprocess.check_output(["git", "ls-files", "-z"], cwd=ROOT, text=True).split("\0")[:-1]
    for name in tracked:
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        # As of now: what an earlier run had added to it is built no more.
        shutil.copy(ROOT / name, copy / name)
    expected = set()
    for title, section in sections.items():
        changed = apply(section, copy)
        stated = re.search(r"\*\*(\d+) files?\*\*", section)
        if len(changed) != (int(stated[1]) if stated else 0):
            sys.exit(f"{PAGE}: {title}: {len(changed)} files change: {', '.join(sorted(changed))}")
        print(f"{title}: {len(changed)}")
        expected |= changed
    grown_test = copy / "daemon/analysis/tests/grown.rs"
    grown_test.parent.mkdir(exist_ok=True)
    shutil.copy(copy / "tests/grown.rs", grown_test)
    test = ["cargo", "test", "--offline", "-p", "dynocar-analysis", "-p", "dynocar-client", "--test"]
    for of in [["grown"], ["client", "bindings::"]]:
        subprocess.run([*test, *of], cwd=copy, env=os.environ | BUILD, check=True)
    differing = {it for it in tracked if (ROOT / it).read_bytes() != (copy / it).read_bytes()}
    if differing - expected != WRITTEN:
        sys.exit(f"{PAGE}: other files differ: {differing - expected ^ WRITTEN}")
    for name in WRITTEN:
        if not all(f"{word} = " in (copy / name).read_text() for word in ADDED):
            sys.exit(f"{name}: expected {', '.join(ADDED)}")


main()
