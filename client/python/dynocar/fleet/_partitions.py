"""A train's Parquet partitions as a dataset, written row group by row group."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import quote

from .._errors import InputError
from . import _toml
from ._extra import needed
from ._folder import Unit

# Columns that describe a run and are the same in all its rows, with the key in the dataset's description.
OF_RUN = {
    "run_role": "role",
    "run_direction": "direction",
    "run_mass_t": "mass_t",
    "run_start_m": "start_m",
}
ROWS_AT_A_TIME = 65_536


def write_dataset(unit: Unit, folder: Path) -> dict[str, Path]:
    """Writes the partitions as a dataset; gives the partition of each of its runs."""
    manifest = _toml.read(unit.manifest)
    columns: dict[str, dict[str, Any]] = manifest.get("columns", {})
    runs: dict[str, dict[str, Any]] = {}
    sources: dict[str, Path] = {}
    for partition in unit.partitions:
        for run in _Partition(partition, columns, folder).write():
            runs[run["file"]] = run
            sources[run["file"]] = partition
    dataset = manifest.get("dataset", {}) | {"delimiter": ",", "decimal": "."}
    tables = {"dataset": {"name": f"train {unit.train}"} | dataset}
    for table, file in (("train", unit.train_file), ("track", unit.track_file)):
        if file is not None:
            tables[table] = {"file": str(file.resolve())}
    _toml.write(tables | {"columns": columns, "runs": list(runs.values())}, folder / "dataset.toml")
    return sources


class _Partition:
    """One file: a run, or several that its column ``run`` distinguishes."""

    def __init__(self, file: Path, columns: dict[str, dict[str, Any]], folder: Path) -> None:
        self.file, self.columns, self.folder = file, columns, folder
        self.pyarrow = needed("pyarrow")
        self.compute = needed("pyarrow.compute")
        self.csv = needed("pyarrow.csv")
        try:
            self.opened: Any = needed("pyarrow.parquet").ParquetFile(file)
        except (OSError, self.pyarrow.ArrowException) as error:
            raise InputError(f"{file}: not a Parquet file: {error}", str(file)) from error
        self.schema: Any = self.opened.schema_arrow
        self.names = list(dict.fromkeys(str(entry.get("column")) for entry in columns.values()))
        for name in self.names:
            if name not in self.schema.names:
                known = ", ".join(self.schema.names)
                raise InputError(f"{file}: no column {name!r}; it has {known}", str(file))
        self.runs: dict[str, dict[str, Any]] = {}

    def write(self) -> list[dict[str, Any]]:
        """Writes each run as CSV; gives what the dataset says of them."""
        described = [name for name in ("run", *OF_RUN) if name in self.schema.names]
        writers: dict[str, Any] = {}
        try:
            batches = self.opened.iter_batches(ROWS_AT_A_TIME, columns=self.names + described)
            for batch in batches:
                for run, rows in self._by_run(batch):
                    table = self._cells(rows)
                    if run not in writers:
                        path = self.folder / self._name(run)
                        path.parent.mkdir(parents=True, exist_ok=True)
                        writers[run] = self.csv.CSVWriter(str(path), table.schema)
                    self._describe(run, rows, described)
                    writers[run].write_table(table)
        except (OSError, self.pyarrow.ArrowException) as error:
            raise InputError(f"{self.file}: cannot be read: {error}", str(self.file)) from error
        finally:
            for writer in writers.values():
                writer.close()
        if not self.runs:
            raise InputError(f"{self.file}: no rows", str(self.file))
        return list(self.runs.values())

    def _name(self, run: str) -> str:
        of_run = f"-{quote(run, safe='')}" if run else ""
        return f"runs/{self.file.parent.name}/{self.file.stem}{of_run}.csv"

    def _by_run(self, batch: Any) -> list[tuple[str, Any]]:
        if "run" not in batch.schema.names:
            return [("", batch)] if batch.num_rows else []
        of_row = batch.column("run")
        if of_row.null_count:
            raise InputError(f"{self.file}: column 'run': a row without a run", str(self.file))
        values = self.compute.unique(of_row)
        equal = self.compute.equal
        return [(str(run), batch.filter(equal(of_row, run))) for run in values]

    def _describe(self, run: str, rows: Any, described: list[str]) -> None:
        known = self.runs.setdefault(run, {"file": self._name(run)})
        for name in described[described[:1] == ["run"] :]:
            values = self.compute.unique(rows.column(name)).to_pylist()
            value = known.setdefault(OF_RUN[name], values[0])
            if values != [value] or value is None:
                words = "expected one value in all rows of a run"
                raise InputError(f"{self.file}: column {name!r}: {words}", str(self.file))

    def _cells(self, rows: Any) -> Any:
        """The columns as numbers in full, or as text."""
        types, cells = self.pyarrow.types, {}
        for name in self.names:
            column, kind = rows.column(name), self.schema.field(name).type
            if types.is_boolean(kind):
                column = column.cast("int8")
            elif types.is_timestamp(kind):
                column = column.cast(self.pyarrow.timestamp("us", kind.tz), safe=False).cast(
                    "int64"
                )
                self._is_timestamp(name)
            elif types.is_floating(kind) or types.is_decimal(kind):
                column = column.cast("float64")
            elif not (types.is_integer(kind) or types.is_string(kind) or types.is_null(kind)):
                words = f"expected numbers, found {kind}"
                raise InputError(f"{self.file}: column {name!r}: {words}", str(self.file))
            cells[name] = column
        return self.pyarrow.table(cells)

    def _is_timestamp(self, name: str) -> None:
        """Such a column brings its unit."""
        for quantity, entry in self.columns.items():
            if entry.get("column") == name:
                self.columns[quantity] = {"column": name, "unit": "us"}
