"""One result file per run: observables computed by one function for all engines, one writer, reader, check, export."""

from dembench.results.export import export_csv, export_vtkhdf
from dembench.results.observe import Observer, observe
from dembench.results.read import Result, ResultError, read, read_records
from dembench.results.schema import Observed, SnapshotSeries, channels
from dembench.results.validate import validate
from dembench.results.write import write

__all__ = [
    "Observed",
    "Observer",
    "Result",
    "ResultError",
    "SnapshotSeries",
    "channels",
    "export_csv",
    "export_vtkhdf",
    "observe",
    "read",
    "read_records",
    "validate",
    "write",
]
