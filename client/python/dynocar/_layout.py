"""Samples and snapshots as they lie in shared memory, for NumPy: from the same table as the structs."""

from __future__ import annotations

import numpy as np

from . import _native


def _dtype(
    names: list[str], formats: list[str], offsets: list[int], size: int
) -> np.dtype[np.void]:
    spec = {"names": names, "formats": formats, "offsets": offsets, "itemsize": size}
    return np.dtype(spec)  # type: ignore[call-overload,no-any-return]


_sample, _snapshot = _native.dtypes()
SAMPLE_DTYPE: np.dtype[np.void] = _dtype(*_sample)
SNAPSHOT_DTYPE: np.dtype[np.void] = _dtype(*_snapshot)
