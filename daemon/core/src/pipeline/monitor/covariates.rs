//! Retardation of the train by one unit of each column at a sample, and the impulse of each column by blocks; one of
//! the columns is the unexplained force of earlier passes at each place of the line.

use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::SuspectInput;
use dynocar_model::train::Davis;
use nalgebra::SVector;

use super::{COVARIATES, covariate};
use crate::pipeline::momentum::UnitSample;

/// One value for each column that comes from samples.
pub type Covariates = SVector<f64, COVARIATES>;

/// A longer gap in s between two samples is the start of a new run.
const RUN_GAP_S: f64 = 900.0;

/// Separates one run from the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RunClock {
    last_ns: Option<i64>,
}

impl RunClock {
    /// Takes in the time of a sample; true when a run starts with it: the first sample, a clock
    /// set back, or a long gap.
    pub fn push(&mut self, time_ns: i64) -> bool {
        let last_ns = self.last_ns.replace(time_ns);
        let gap_s = last_ns.map(|last_ns| time_ns.saturating_sub(last_ns) as f64 * 1e-9);
        !gap_s.is_some_and(|gap_s| (0.0..=RUN_GAP_S).contains(&gap_s))
    }
}

/// Returns the retarding force in N/kN of one unit of each column.
pub fn covariates(
    sample: &ResolvedSample,
    unit: &UnitSample,
    declared: &Davis,
    places: &PlaceMemory,
) -> Covariates {
    let earlier = sample.position_m.map(|m| places.earlier(m, sample.direction));
    let earlier = earlier.unwrap_or_default();
    let seen = SuspectInput {
        speed_mps: sample.speed_mps,
        direction: sample.direction,
        curvature_per_m: sample.curvature_per_m,
        tunnel_share: sample.tunnel_share,
        ambient_temperature_degc: sample.ambient_temperature_degc,
        since_cold_s: sample.since_cold_s,
        davis: *declared,
        traction: unit.traction,
        brake: unit.brake,
        driving: unit.driving,
        earlier: earlier.resistance,
        earlier_uphill: earlier.uphill,
    };
    Covariates::from_fn(|place, _| (covariate(place).unit)(&seen))
}

/// Integrals of the covariates from the mean of one block to that of the next, weighed as the
/// momentum's own impulse is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CovariateImpulse {
    chain_start_ns: i64,
    last_ns: i64,
    last: Covariates,
    integral: Covariates,
    sum: Covariates,
    count: f64,
}

impl CovariateImpulse {
    /// Without samples.
    pub fn new() -> Self {
        CovariateImpulse {
            chain_start_ns: i64::MIN,
            last_ns: 0,
            last: Covariates::zeros(),
            integral: Covariates::zeros(),
            sum: Covariates::zeros(),
            count: 0.0,
        }
    }

    /// Takes in a sample of the chain that began at `chain_start_ns`.
    pub fn push(&mut self, chain_start_ns: i64, time_ns: i64, values: &Covariates) {
        if chain_start_ns == self.chain_start_ns && time_ns != chain_start_ns {
            let half_s = 0.5 * time_ns.saturating_sub(self.last_ns) as f64 * 1e-9;
            self.integral += (self.last + values) * half_s;
        } else {
            *self = CovariateImpulse { chain_start_ns, ..CovariateImpulse::new() };
        }
        self.sum += self.integral;
        self.count += 1.0;
        (self.last, self.last_ns) = (*values, time_ns);
    }

    /// Ends the block; gives the impulse since the mean of the one before.
    pub fn close(&mut self) -> Covariates {
        let mean = self.sum / self.count.max(1.0);
        self.integral -= mean;
        self.sum = Covariates::zeros();
        self.count = 0.0;
        mean
    }
}

/// Length of a cell in m.
const CELL_M: f64 = 150.0;
/// Cells; longer lines share them.
const CELLS: usize = 2048;
/// Passes in a direction that the mean looks back over.
const PASSES_MAX: f64 = 6.0;

/// A mean over passes of one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Mean {
    n_per_kn: f64,
    passes: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Cell {
    index: i64,
    pass: u32,
    /// Means over the passes before this one, towards falling and growing chainage.
    earlier: [Mean; 2],
    /// Direction of this pass.
    is_growing: bool,
    /// Mean over this pass.
    now: f64,
    count: f64,
}

/// Unexplained force of earlier passes at a place, in N/kN; 0 where there was no pass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Earlier {
    /// As a resistance: the same in both directions.
    pub resistance: f64,
    /// As an error of the gradient, which acts the other way in the other direction; as it acts
    /// in the direction asked for.
    pub uphill: f64,
    /// Passes behind it.
    pub passes: f64,
}

/// Unexplained force by place.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaceMemory {
    cells: Vec<Cell>,
    pass: u32,
}

impl PlaceMemory {
    /// Returns an empty memory; its only allocation.
    pub fn new() -> Self {
        PlaceMemory { cells: vec![Cell { index: i64::MIN, ..Cell::default() }; CELLS], pass: 1 }
    }

    /// A new pass begins.
    pub fn next_pass(&mut self) {
        self.pass = self.pass.wrapping_add(1);
    }

    /// Returns the unexplained force of the passes before this one at a place, for travel in a direction.
    pub fn earlier(&self, position_m: f64, direction: f64) -> Earlier {
        let (slot, index) = slot(position_m);
        let cell = &self.cells[slot];
        match cell.index == index {
            true if cell.pass == self.pass => mean_of_both(&cell.earlier, direction),
            true => mean_of_both(&cell.with_pass_closed().earlier, direction),
            false => Earlier::default(),
        }
    }

    /// Takes in the unexplained force in N/kN of a block.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn push(&mut self, position_m: f64, direction: f64, n_per_kn: f64) {
        let (slot, index) = slot(position_m);
        let is_growing = direction > 0.0;
        let cell = &mut self.cells[slot];
        if cell.index != index {
            *cell = Cell { index, pass: self.pass, is_growing, ..Cell::default() };
        } else if cell.pass != self.pass || cell.is_growing != is_growing {
            *cell = Cell { pass: self.pass, is_growing, ..cell.with_pass_closed() };
        }
        cell.count += 1.0;
        cell.now += (n_per_kn - cell.now) / cell.count;
    }
}

/// The means of both directions, as they act in one.
fn mean_of_both([falling, growing]: &[Mean; 2], direction: f64) -> Earlier {
    let passes = falling.passes + growing.passes;
    if passes == 0.0 {
        return Earlier::default();
    }
    let (down, up) = (falling.n_per_kn * falling.passes, growing.n_per_kn * growing.passes);
    Earlier { resistance: (up + down) / passes, uphill: direction * (up - down) / passes, passes }
}

impl Cell {
    fn with_pass_closed(&self) -> Cell {
        if self.count == 0.0 {
            return *self;
        }
        let mut closed = Cell { now: 0.0, count: 0.0, ..*self };
        let mean = &mut closed.earlier[usize::from(self.is_growing)];
        mean.passes = (mean.passes + 1.0).min(PASSES_MAX);
        mean.n_per_kn += (self.now - mean.n_per_kn) / mean.passes;
        closed
    }
}

fn slot(position_m: f64) -> (usize, i64) {
    let index = (position_m / CELL_M).floor() as i64;
    (index.rem_euclid(CELLS as i64) as usize, index)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_covariate_gives_the_time_between_the_means_of_blocks() {
        let mut impulse = CovariateImpulse::new();
        let ones = Covariates::repeat(2.0);
        for k in 0..10 {
            impulse.push(0, k * 1_000_000_000, &ones);
        }
        assert!((impulse.close()[0] - 2.0 * 4.5).abs() < 1e-12);
        for k in 10..20 {
            impulse.push(0, k * 1_000_000_000, &ones);
        }
        assert!((impulse.close()[0] - 2.0 * 10.0).abs() < 1e-12);
    }

    #[test]
    fn a_run_starts_when_the_clock_is_set_back() {
        let mut clock = RunClock::default();
        assert!(clock.push(5_000_000_000));
        assert!(!clock.push(6_000_000_000));
        assert!(clock.push(1_000_000_000));
        assert!(clock.push(1_000_000_000_000));
    }
}

#[cfg(test)]
mod place_memory_tests {
    use super::*;

    #[test]
    fn only_earlier_passes_are_remembered() {
        let mut memory = PlaceMemory::new();
        let resistance = |memory: &PlaceMemory, at_m: f64| memory.earlier(at_m, 1.0).resistance;
        memory.push(1000.0, 1.0, 3.0);
        assert_eq!(resistance(&memory, 1000.0), 0.0);
        memory.next_pass();
        assert_eq!(resistance(&memory, 1000.0), 3.0);
        memory.push(1000.0, 1.0, 1.0);
        assert_eq!(resistance(&memory, 1000.0), 3.0);
        memory.next_pass();
        assert_eq!(resistance(&memory, 1010.0), 2.0);
        assert_eq!(resistance(&memory, 5000.0), 0.0);
        assert_eq!(resistance(&memory, 1000.0 + CELL_M * CELLS as f64), 0.0);
    }

    #[test]
    fn both_directions_show_a_resistance_from_a_wrong_gradient() {
        for (back_n_per_kn, expected) in [(2.0, (2.0, 0.0)), (-2.0, (0.0, 2.0))] {
            let mut memory = PlaceMemory::new();
            memory.push(700.0, 1.0, 2.0);
            memory.next_pass();
            let one_way = memory.earlier(700.0, -1.0);
            assert_eq!((one_way.resistance, one_way.uphill), (2.0, -2.0), "not yet distinguished");
            memory.push(700.0, -1.0, back_n_per_kn);
            memory.next_pass();
            let both = memory.earlier(700.0, 1.0);
            assert_eq!((both.resistance, both.uphill), expected);
            assert_eq!(memory.earlier(700.0, -1.0).uphill, -expected.1);
        }
    }
}
