//! What was left unexplained at each place of the line in earlier passes.

/// Length of a cell in m.
const CELL_M: f64 = 150.0;
/// Cells; longer lines share them.
const CELLS: usize = 2048;
/// Passes that the mean looks back over.
const PASSES_MAX: f64 = 6.0;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Cell {
    index: i64,
    pass: u32,
    /// Means over the passes before this one.
    earlier: f64,
    passes: f64,
    /// Mean over this pass.
    now: f64,
    count: f64,
}

/// Unexplained force by place.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaceMemory {
    cells: Vec<Cell>,
    pass: u32,
}

impl PlaceMemory {
    /// An empty memory; its only allocation.
    pub fn new() -> Self {
        PlaceMemory { cells: vec![Cell { index: i64::MIN, ..Cell::default() }; CELLS], pass: 1 }
    }

    /// A new pass begins.
    pub fn next_pass(&mut self) {
        self.pass = self.pass.wrapping_add(1);
    }

    /// The mean force in N/kN of the passes before this one; 0 where there was none.
    pub fn earlier(&self, position_m: f64) -> f64 {
        let (place, index) = place(position_m);
        let cell = &self.cells[place];
        match cell.index == index {
            true if cell.pass == self.pass => cell.earlier,
            true => cell.with_pass_closed().earlier,
            false => 0.0,
        }
    }

    /// Takes in the unexplained force in N/kN of a block.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn push(&mut self, position_m: f64, n_per_kn: f64) {
        let (place, index) = place(position_m);
        let cell = &mut self.cells[place];
        if cell.index != index {
            *cell = Cell { index, pass: self.pass, ..Cell::default() };
        } else if cell.pass != self.pass {
            *cell = Cell { pass: self.pass, ..cell.with_pass_closed() };
        }
        cell.count += 1.0;
        cell.now += (n_per_kn - cell.now) / cell.count;
    }
}

impl Cell {
    fn with_pass_closed(&self) -> Cell {
        if self.count == 0.0 {
            return *self;
        }
        let passes = (self.passes + 1.0).min(PASSES_MAX);
        let earlier = self.earlier + (self.now - self.earlier) / passes;
        Cell { earlier, passes, now: 0.0, count: 0.0, ..*self }
    }
}

fn place(position_m: f64) -> (usize, i64) {
    let index = (position_m / CELL_M).floor() as i64;
    (index.rem_euclid(CELLS as i64) as usize, index)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_earlier_passes_are_remembered() {
        let mut memory = PlaceMemory::new();
        memory.push(1000.0, 3.0);
        assert_eq!(memory.earlier(1000.0), 0.0);
        memory.next_pass();
        assert_eq!(memory.earlier(1000.0), 3.0);
        memory.push(1000.0, 1.0);
        assert_eq!(memory.earlier(1000.0), 3.0);
        memory.next_pass();
        assert_eq!(memory.earlier(1010.0), 2.0);
        assert_eq!(memory.earlier(5000.0), 0.0);
        assert_eq!(memory.earlier(1000.0 + CELL_M * CELLS as f64), 0.0);
    }
}
