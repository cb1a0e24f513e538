"""Draws what a command prints as an SVG: python3 terminal_picture.py 'dynocar --help' < text > picture.svg

Lines are cut at 110 columns, so that a page shows them at a size that can be read."""

import sys
from html import escape

COLUMNS, LINES = 110, 60
WIDTH, HEIGHT, MARGIN, BAR = 7.8, 17, 14, 30


def picture(command: str, text: str) -> str:
    """The command and its text as a window of a terminal; readers of screens get the text."""
    lines = [line.rstrip().expandtabs(8) for line in text.rstrip("\n").split("\n")]
    shown = [line if len(line) <= COLUMNS else line[: COLUMNS - 1] + "…" for line in lines[:LINES]]
    if len(lines) > LINES:
        shown.append("…")
    shown.insert(0, f"$ {command}")
    columns = max(len(line) for line in shown)
    width = round(2 * MARGIN + columns * WIDTH)
    height = BAR + MARGIN + HEIGHT * len(shown)
    kinds = [' class="c"'] + [""] * len(lines)
    rows = [
        f'<text{kind} x="{MARGIN}" y="{BAR + HEIGHT * (k + 1) - 4}" xml:space="preserve">'
        f"{escape(line)}</text>"
        for k, (line, kind) in enumerate(zip(shown, kinds))
        if line
    ]
    dots = "".join(f'<circle cx="{18 + 18 * k}" cy="15" r="5.5" fill="#b9c0c8"/>' for k in range(3))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}" role="img"><title>{escape(command)}</title>'
        "<style>text{font:13px ui-monospace,Menlo,Consolas,'DejaVu Sans Mono',monospace;fill:#1f2933}"
        ".c{fill:#0b5cad;font-weight:600}</style>"
        f'<rect width="{width}" height="{height}" rx="8" fill="#f7f8fa" stroke="#cfd5db"/>'
        f'<path d="M0 {BAR}H{width}" stroke="#cfd5db"/>{dots}\n'
        + "\n".join(rows)
        + "\n</svg>\n"
    )


if __name__ == "__main__":
    sys.stdout.write(picture(sys.argv[1], sys.stdin.read()))
