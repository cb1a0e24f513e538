//! Publisher and reader as Python holds them.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use dynocar_client::ffi::{Code, ReadingCopy};
use dynocar_client::{SamplePublisher, SnapshotReader, monotonic_now_ns};
use dynocar_shared::services::PIPELINES_MAX;
use dynocar_shared::{PipelineKind, Quantity, SampleField, TrainId, TrainSample};
use pyo3::prelude::*;

use crate::calls::{SIGNALS_EVERY, of_code};
use crate::ends::Handle;
use crate::snapshot::Reading;

/// `SamplePublisher` without its documentation.
#[pyclass(frozen, module = "dynocar._native")]
pub(crate) struct Publisher(Handle<SamplePublisher>);

#[pymethods]
impl Publisher {
    #[new]
    fn open(py: Python<'_>, train_id: u64, root: Option<PathBuf>) -> PyResult<Self> {
        Handle::open(py, train_id, root, SamplePublisher::open).map(Publisher)
    }

    fn start_run(&self, py: Python<'_>) -> PyResult<()> {
        self.0.with(py, SamplePublisher::start_run)
    }

    /// Publishes a sample; the values are in the order of [`SampleField`].
    fn publish(
        &self,
        py: Python<'_>,
        time_ns: Option<i64>,
        direction: i8,
        flags: u8,
        values: [Option<f64>; SampleField::ALL.len()],
    ) -> PyResult<u64> {
        let mut sample = TrainSample::empty(TrainId(0));
        sample.time_ns = time_ns.unwrap_or_else(monotonic_now_ns);
        (sample.direction, sample.flags) = (direction, flags);
        for (field, value) in SampleField::ALL.into_iter().zip(values) {
            if let Some(value) = value {
                sample.set(field, value);
            }
        }
        let sent = self.0.with(py, |publisher| publisher.publish(&mut sample))?;
        sent.map_err(|refused| of_code(py, Code::from(refused)))
    }

    /// Waits for short times, between which Ctrl-C is heard.
    fn flush(&self, py: Python<'_>, patience_s: f64) -> PyResult<u64> {
        let patience = Duration::try_from_secs_f64(patience_s.max(0.0)).unwrap_or(Duration::MAX);
        let start = Instant::now();
        loop {
            let time = SIGNALS_EVERY.min(patience.saturating_sub(start.elapsed()));
            let begun = Instant::now();
            let left = self.0.with_patience(py, move |publisher| publisher.flush(time))?;
            py.check_signals()?;
            // A result that comes back early waits for nobody.
            let is_hopeless = begun.elapsed() < time;
            if left == 0 || is_hopeless || start.elapsed() >= patience {
                return Ok(left);
            }
        }
    }

    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.0.close(py)
    }
}

/// `SnapshotReader` without its documentation.
#[pyclass(frozen, module = "dynocar._native")]
pub(crate) struct Reader(Handle<SnapshotReader>);

#[pymethods]
impl Reader {
    #[new]
    fn open(py: Python<'_>, train_id: u64, root: Option<PathBuf>) -> PyResult<Self> {
        Handle::open(py, train_id, root, SnapshotReader::open).map(Reader)
    }

    fn set_stale_after_ns(&self, py: Python<'_>, stale_after_ns: i64) -> PyResult<()> {
        if stale_after_ns <= 0 {
            return Err(of_code(py, Code::BadNumber));
        }
        self.0.with(py, |reader| reader.set_stale_after_ns(stale_after_ns))
    }

    fn poll(&self, py: Python<'_>) -> PyResult<usize> {
        self.0.with(py, SnapshotReader::poll)
    }

    fn quantity(&self, py: Python<'_>, number: u32, now_ns: Option<i64>) -> PyResult<Reading> {
        let quantity = Quantity::from_number(number).ok_or_else(|| of_code(py, Code::BadNumber))?;
        self.pick(py, now_ns, |reader, now_ns| Ok(reader.quantity(quantity, now_ns)?.into()))
    }

    fn latest(&self, py: Python<'_>, number: u32, now_ns: Option<i64>) -> PyResult<Reading> {
        let kind = PipelineKind::from_number(number).ok_or_else(|| of_code(py, Code::BadNumber))?;
        self.pick(py, now_ns, |reader, now_ns| {
            reader.latest(kind, now_ns).map(ReadingCopy::from).ok_or(Code::NoSnapshot)
        })
    }

    fn latest_by_index(
        &self,
        py: Python<'_>,
        index: u32,
        now_ns: Option<i64>,
    ) -> PyResult<Reading> {
        if index as usize >= PIPELINES_MAX {
            return Err(of_code(py, Code::BadNumber));
        }
        self.pick(py, now_ns, |reader, now_ns| {
            let found = reader.readings(now_ns).find(|it| it.snapshot.pipeline_index == index);
            found.map(ReadingCopy::from).ok_or(Code::NoSnapshot)
        })
    }

    fn refused(&self, py: Python<'_>) -> PyResult<u64> {
        self.0.with(py, |reader| reader.refused())
    }

    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.0.close(py)
    }
}

impl Reader {
    /// Returns a reading, or the code that says why there is none.
    fn pick(
        &self,
        py: Python<'_>,
        now_ns: Option<i64>,
        pick: impl FnOnce(&SnapshotReader, i64) -> Result<ReadingCopy, Code>,
    ) -> PyResult<Reading> {
        let now_ns = now_ns.unwrap_or_else(monotonic_now_ns);
        let picked = self.0.with(py, |reader| pick(reader, now_ns))?;
        Ok(match picked {
            Ok(copy) => Reading { code: Code::Ok, copy },
            Err(code) => Reading { code, copy: ReadingCopy::none() },
        })
    }
}
