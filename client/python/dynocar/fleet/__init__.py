"""Many trains and months at once: ``explain`` on the workers of a Dask cluster, and one report.

    from dynocar.fleet import explain_fleet

    fleet = explain_fleet("fleet", "report", workers=2)
    print([it["train"] for it in fleet.report["differing"] if it["is_found"]])

On the command line ``python -m dynocar.fleet explain FOLDER -o OUT``. Needs ``pip install
'dynocar[fleet]'``; ``docs/guides/fleet.md`` shows more.
"""

from ._fleet import Fleet, explain_fleet, write_report

__all__ = ["Fleet", "explain_fleet", "write_report"]
