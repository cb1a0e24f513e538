"""Dynocar in Python: publish samples and poll parameter snapshots as a train controller does, and learn
from recorded runs how a train really moves.

    import dynocar

    with dynocar.SamplePublisher(1) as publisher, dynocar.SnapshotReader(1) as reader:
        publisher.publish(speed_mps=21.5, traction_force_n=0.0, brake_force_n=0.0)
        reader.poll()
        snapshot = reader.resistance()
        if snapshot.is_usable:
            print(snapshot.resistance_at(21.5))
        else:
            print("built-in parameters, since", snapshot.why)

    explanation = dynocar.explain("my_train")
    print(explanation.verdict, [effect.kind for effect in explanation.effects])

``docs/guides/python.md`` shows more.
"""

from ._channel import (
    Resistance,
    SamplePublisher,
    Snapshot,
    SnapshotReader,
    daemon_state,
    monotonic_now_ns,
    version,
)
from ._errors import ChannelError, DynocarError, InputError, WorkError
from ._layout import SAMPLE_DTYPE, SNAPSHOT_DTYPE
from ._native import ParameterSnapshot
from ._recorded import (
    BaseResistance,
    Checked,
    Dataset,
    Davis,
    Estimator,
    Explanation,
    FoundEffect,
    GrownFiles,
    Identified,
    Note,
    Place,
    Plot,
    Run,
    Table,
    check,
    explain,
    identify,
    read_dataset,
)
from ._records import Record
from ._stopping import Stop, StoppingEstimate
from ._vocabulary import (
    Code,
    DaemonState,
    Effect,
    Has,
    Manoeuvre,
    Parameter,
    PipelineKind,
    MassSource,
    Quantity,
    Rail,
    Reason,
    RejectionReason,
    Status,
    UseState,
)

__version__ = version()

__all__ = [
    "BaseResistance",
    "ChannelError",
    "Checked",
    "Code",
    "DaemonState",
    "Dataset",
    "Davis",
    "DynocarError",
    "Effect",
    "Estimator",
    "Explanation",
    "FoundEffect",
    "GrownFiles",
    "Has",
    "Identified",
    "InputError",
    "Manoeuvre",
    "Note",
    "Parameter",
    "ParameterSnapshot",
    "PipelineKind",
    "Place",
    "Plot",
    "MassSource",
    "Quantity",
    "Rail",
    "Reason",
    "Record",
    "RejectionReason",
    "Resistance",
    "Run",
    "SAMPLE_DTYPE",
    "SNAPSHOT_DTYPE",
    "SamplePublisher",
    "Snapshot",
    "SnapshotReader",
    "Status",
    "Stop",
    "StoppingEstimate",
    "UseState",
    "Table",
    "WorkError",
    "__version__",
    "check",
    "daemon_state",
    "explain",
    "identify",
    "monotonic_now_ns",
    "read_dataset",
    "version",
]
