//! What a model makes of the bins of a run, for every a, b and c at once.

/// Modelled speeds in m/s at the bins of a run, each segment starting from zero: linear in a, b and c, so
/// that these need no look at the samples again.
#[derive(Clone, Debug, Default)]
pub struct Response {
    /// Without a, b and c.
    pub rest: Vec<f64>,
    /// What each unit of a, b and c adds.
    pub davis: [Vec<f64>; 3],
}

impl Response {
    /// The speeds for some a, b and c.
    pub fn bins(&self, [a, b, c]: [f64; 3], bins: &mut Vec<f64>) {
        let [by_a, by_b, by_c] = &self.davis;
        let davis = by_a.iter().zip(by_b).zip(by_c);
        let rows = self.rest.iter().zip(davis);
        bins.clear();
        bins.extend(rows.map(|(rest, ((by_a, by_b), by_c))| rest + a * by_a + b * by_b + c * by_c));
    }

    /// Adds a multiple of another.
    pub fn add(&mut self, times: f64, other: &Response) {
        self.each(other, |own, other| *own += times * other);
    }

    /// Becomes the change from another for each unit of what differs by so much.
    pub fn become_slope_from(&mut self, other: &Response, by: f64) {
        self.each(other, |own, other| *own = (*own - other) / by);
    }

    fn each(&mut self, other: &Response, change: impl Fn(&mut f64, f64)) {
        let own = std::iter::once(&mut self.rest).chain(&mut self.davis);
        for (own, other) in own.zip(std::iter::once(&other.rest).chain(&other.davis)) {
            own.iter_mut().zip(other).for_each(|(own, &other)| change(own, other));
        }
    }
}
