//! How many samples viewers get: a picture needs no thousand a second.

/// Lets through as many as are wanted of what comes faster, evenly.
#[derive(Clone, Copy, Debug)]
pub struct Thinning {
    interval_ns: i64,
    due_ns: i64,
}

impl Thinning {
    /// Lets `per_second` samples a second through; all, when it is 0.
    pub fn to(per_second: u32) -> Self {
        let interval_ns = 1_000_000_000_i64.checked_div(i64::from(per_second)).unwrap_or(0);
        Thinning { interval_ns, due_ns: i64::MIN }
    }

    /// True where what came at this moment is to go on.
    pub fn lets_through(&mut self, at_ns: i64) -> bool {
        if at_ns < self.due_ns && self.due_ns.saturating_sub(at_ns) <= self.interval_ns {
            return false;
        }
        // After a gap, or where the clock was set back, the count begins anew.
        let is_even = (0..self.interval_ns).contains(&at_ns.saturating_sub(self.due_ns));
        self.due_ns = if is_even { self.due_ns } else { at_ns }.saturating_add(self.interval_ns);
        true
    }
}
