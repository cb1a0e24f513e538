"""``python -m dynocar.fleet``; ends with 0 done, 1 the work or a train failed, 2 a wrong input."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from .._errors import DynocarError, InputError
from ._fleet import Fleet, explain_fleet, write_report


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m dynocar.fleet", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    explain = commands.add_parser("explain", help="explain every train, then report")
    explain.add_argument(
        "folder", type=Path, help="train=NAME/day=YYYY-MM-DD/*.parquet or datasets"
    )
    explain.add_argument("-o", "--out", type=Path, required=True, help="answers and the report")
    explain.add_argument(
        "--scheduler", metavar="ADDRESS", help="a Dask scheduler, as tcp://host:8786"
    )
    explain.add_argument(
        "--workers", type=_count, metavar="N", help="processes here, else one a core"
    )
    explain.add_argument("--traction-only", action="store_true", help="forces under traction only")
    report = commands.add_parser("report", help="the report anew, from answers that are kept")
    report.add_argument("out", type=Path, help="what `explain` was given as -o")
    for command in (explain, report):
        command.add_argument("--month", metavar="YYYY-MM", help="report this month, else the last")
    return parser


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a number of workers from 1, got {text!r}")
    return int(text)


def _done(given: argparse.Namespace) -> Fleet:
    if given.command == "report":
        return write_report(given.out, month=given.month)
    return explain_fleet(
        given.folder,
        given.out,
        scheduler=given.scheduler,
        workers=given.workers,
        month=given.month,
        traction_only=given.traction_only,
    )


def _tell(fleet: Fleet) -> None:
    report = fleet.report
    month = f", {report['month']}" if report["month"] else ""
    print(f"{len(report['trains'])} trains explained{month}, {len(fleet.failed)} failed")
    for it in report["failed"]:
        print(f"failed: {it['train']} {it['month'] or ''}: {it['error']}")
    for it in report["differing"]:
        if it["is_found"]:
            beside = f"{it['own']['value']:.4g} beside {it['others']['mean']:.4g}"
            print(f"differs: {it['train']} in {it['parameter']}: {beside}, z = {it['z']:.1f}")
    for it in report["common"]:
        count = sum(part["state"] == "found" for part in it["trains"])
        owner = it["belongs_to"].replace("_", " ")
        print(f"{it['name']}: found by {count} of {len(it['trains'])}, belongs to: {owner}")
    for it in report["changes"]:
        if it["is_found"]:
            print(
                f"changed: {it['train']} in {it['parameter']}: {it['change']:+.4g}, z = {it['z']:.1f}"
            )
    print(f"report: {fleet.html_file}")


def main() -> int:
    """Runs the command line; gives the exit status."""
    given = _parser().parse_args()
    try:
        fleet = _done(given)
        status = 1 if fleet.failed else 0
        _tell(fleet)
        sys.stdout.flush()
    except DynocarError as error:
        print(f"dynocar.fleet: {error}", file=sys.stderr)
        return 2 if isinstance(error, InputError) else 1
    except BrokenPipeError:
        # The reader has gone; Python's own flush at the end shall not complain either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        print(
            f"dynocar.fleet: standard output: cannot be written: {error.strerror}", file=sys.stderr
        )
        return 1
    return status


if __name__ == "__main__":
    sys.exit(main())
