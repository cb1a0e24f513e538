"""The fleet's report as one page that loads nothing and runs no script."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

from .._native import effect_words, parameter_words
from ._estimates import UNITS
from ._forest import Row, forest

OWNERS = {
    "line": "it belongs to the line",
    "fleet": "it belongs to all trains",
    "train": "it belongs to one train",
    "some_trains": "it belongs to some trains",
    "undecided": "whether the others have it their data do not show",
}
STATES = {
    "found": "found",
    "absent": "its data show that it is not there",
    "cannot_tell": "its data do not show it",
    "not_asked": "was not asked",
    "failed": "asking failed",
}
PARAMETERS = {
    "a": "a less the declared one",
    "b": "b less the declared one",
    "c": "c less the declared one",
    "mass": "mass over the declared one",
    "traction_gain": "traction gain",
    "wheel_diameter": "measured over true speed",
}
Report = dict[str, Any]


def page(report: Report) -> str:
    """The whole page."""
    month = f", {report['month']}" if report["month"] else ""
    title = f"A fleet of {len(report['trains'])} trains{month}"
    policy = "default-src 'none'; style-src 'unsafe-inline'"
    style = Path(__file__).with_name("_page.css").read_text(encoding="utf-8")
    main = "".join(
        part(report) for part in (_summary, _failed, _differing, _common, _changes, _trains, _how)
    )
    samples = sum(train["samples"] for train in report["trains"])
    runs = sum(train["runs"] for train in report["trains"])
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n"
        f'<header>\n<h1>{escape(title)}</h1>\n<p class="facts">{runs} runs, {samples:,} samples</p>\n'
        f"</header>\n<main>\n{main}</main>\n<footer><p>Made by Dynocar {escape(report['version'])}. "
        "The page is complete in itself: it loads nothing.</p></footer>\n</body>\n</html>\n"
    )


def _summary(report: Report) -> str:
    """What stands out, in a few lines."""
    lines = []
    for it in report["differing"]:
        if it["is_found"]:
            lines.append(f"train {it['train']} differs from the others in {PARAMETERS[it['parameter']]}")
    for it in report["common"]:
        found = [part["train"] for part in it["trains"] if part["state"] == "found"]
        by = f"train {found[0]}" if len(found) == 1 else f"{len(found)} trains"
        lines.append(
            f"{_effect(it)}: found by {by} of {len(it['trains'])}; {OWNERS[it['belongs_to']]}"
        )
    for it in report["changes"]:
        if it["is_found"]:
            lines.append(f"train {it['train']} has changed in {PARAMETERS[it['parameter']]}")
    lines += [f"train {it['train']} failed" for it in report["failed"]]
    if not lines:
        return '<div class="summary">No train stands out, and no effect was found.</div>\n'
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f'<div class="summary open"><ul>{items}</ul></div>\n'


def _effect(it: Report) -> str:
    return " ".join(_words(it)).strip()


def _words(it: Report) -> tuple[str, str]:
    """The kind of an effect, and where it acts."""
    return effect_words(it["kind"], [it["interval_m"]] if it["interval_m"] else [])


def _failed(report: Report) -> str:
    rows = [[it["train"], it["month"] or "", it["error"]] for it in report["failed"]]
    return (
        _section("Trains that failed", "", _table(["train", "month", "error"], rows))
        if rows
        else ""
    )


def _differing(report: Report) -> str:
    if not report["differing"]:
        return _section("Which trains differ", "Too few trains have estimates to compare.", "")
    figures, rows, marked = "", [], []
    for name in dict.fromkeys(it["parameter"] for it in report["differing"]):
        of = [it for it in report["differing"] if it["parameter"] == name]
        drawn = [Row(it["train"], *_estimate(it["own"]), it["is_found"]) for it in of]
        others = next((it["others"] for it in of if not it["is_found"]), of[0]["others"])
        null = 0.0 if name in "abc" else 1.0
        svg = forest(drawn, (others["low"], others["high"]), null)
        caption = f"{PARAMETERS[name]}, {UNITS[name]}" if name in "abc" else PARAMETERS[name]
        figures += f"<figure><figcaption>{escape(caption)}</figcaption>{svg}</figure>"
        for it in of:
            marked.append(it["is_found"])
            rows.append(
                [
                    it["train"],
                    name,
                    f"{it['own']['value']:.4g} ± {1.96 * it['own']['std']:.2g}",
                    f"{it['others']['mean']:.4g}",
                    f"{it['others']['std_between']:.2g}",
                    f"{it['z']:+.1f}",
                    f"{it['p_value']:.2g}",
                ]
            )
    order = sorted(range(len(rows)), key=lambda k: not marked[k])
    heads = ["train", "parameter", "its own", "the others", "scatter between them", "z", "p"]
    table = _table(heads, [rows[k] for k in order], [marked[k] for k in order], numbers=5)
    note = (
        "Each train against the pooled mean of the others. Coloured: differs by more than the "
        f"intervals say, at most {100 * report['false_discovery_rate']:.0f} % of these falsely in the "
        "mean. The band is the 95 % interval of the others' mean."
    )
    return _section("Which trains differ", note, f'<div class="panels">{figures}</div>{table}')


def _common(report: Report) -> str:
    if not report["common"]:
        return _section("Effects over trains", "No train's answer names an effect.", "")
    parts = ""
    for it in report["common"]:
        pooled, unit = it["pooled"], f" {it['unit']}" if it["unit"] else ""
        words = f"{OWNERS[it['belongs_to']].capitalize()}."
        if pooled:
            number = parameter_words(it["parameter"])
            words += f" {number[0].upper()}{number[1:]}: {pooled['mean']:.4g}{unit}"
            words += f" (95 % {pooled['low']:.4g} to {pooled['high']:.4g}) over {pooled['estimates']} trains"
            words += f", scatter between trains {pooled['std_between']:.2g}."
        drawn = [
            Row(part["train"], part["value"], part["std"], part["state"] == "absent")
            for part in it["trains"]
            if part["value"] is not None
        ]
        band = (pooled["low"], pooled["high"]) if pooled else None
        rows = [[part["train"], STATES[part["state"]]] for part in it["trains"]]
        svg = f"<figure>{forest(drawn, band, it['no_effect'])}</figure>" if drawn else ""
        heading, body = escape(_effect(it)), f"{svg}<div>{_table(['train', 'says'], rows)}</div>"
        parts += f'<h3>{heading}</h3><p>{escape(words)}</p><div class="panels">{body}</div>'
    note = "A train that did not find an effect does not count as zero: what its data say stands next to it."
    return _section("Effects over trains", note, parts)


def _changes(report: Report) -> str:
    if report["month_before"] is None:
        return ""
    rows = [
        [
            it["train"],
            it["parameter"],
            f"{it['before']['value']:.4g}",
            f"{it['now']['value']:.4g}",
            f"{it['change']:+.3g} ({it['interval_95'][0]:+.3g} to {it['interval_95'][1]:+.3g})",
            f"{it['z']:+.1f}",
        ]
        for it in report["changes"]
    ]
    marked = [it["is_found"] for it in report["changes"]]
    order = sorted(range(len(rows)), key=lambda k: not marked[k])
    heads = ["train", "parameter", "before", "now", "change and its 95 % interval", "z"]
    table = _table(heads, [rows[k] for k in order], [marked[k] for k in order], numbers=4)
    came = [
        [it["train"], it["what"], *_words(it)] for it in report["effects_changed"]
    ]
    if came:
        table += _table(["train", "effect", "kind", "where"], came)
    return _section(f"What changed since {report['month_before']}", "", table)


def _trains(report: Report) -> str:
    rows = [
        [it["train"], it["line"] or "not known", str(it["runs"]), it["verdict"], it["statement"]]
        for it in report["trains"]
    ]
    return _section(
        "Each train", "", _table(["train", "line", "runs", "verdict", "statement"], rows)
    )


def _how(report: Report) -> str:
    words = (
        "Means over trains are of random effects: the scatter between trains by restricted maximum "
        "likelihood, the interval after Knapp and Hartung. Trains are reported to differ with false "
        "discoveries kept below the rate after Benjamini and Yekutieli. Formulas and their tests: "
        "docs/guides/fleet.md."
    )
    return _section("How it is computed", words, "")


def _estimate(estimate: Report) -> tuple[float, float]:
    return estimate["value"], estimate["std"]


def _section(heading: str, note: str, body: str) -> str:
    words = f'<p class="note">{escape(note)}</p>' if note else ""
    return f"<section>\n<h2>{escape(heading)}</h2>\n{words}{body}\n</section>\n"


def _table(
    heads: list[str], rows: list[list[str]], marked: list[bool] | None = None, numbers: int = 0
) -> str:
    """A table whose last columns are numbers."""
    first = len(heads) - numbers

    def cells(tag: str, row: list[str]) -> str:
        kinds = [' class="number"' if k >= first else "" for k in range(len(row))]
        return "".join(f"<{tag}{kind}>{escape(cell)}</{tag}>" for kind, cell in zip(kinds, row))

    body = "".join(
        f"<tr{' class=marked' if is_marked else ''}>{cells('td', row)}</tr>"
        for row, is_marked in zip(rows, marked or [False] * len(rows))
    )
    head = f"<thead><tr>{cells('th', heads)}</tr></thead>"
    return f'<div class="scroll" tabindex="0"><table>{head}<tbody>{body}</tbody></table></div>'
