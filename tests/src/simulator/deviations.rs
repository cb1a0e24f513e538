//! Deviations of everything that is declared, without an undeclared effect.

/// Deviations of the declared figures from the true ones: standard deviations unless stated otherwise.
///
/// An undeclared effect of a kind takes the place of the deviation of the same kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueDeviations {
    /// Deviation of the true from the declared mass, from run to run.
    pub mass_share: f64,
    /// Deviation of the load, drawn anew at each stop of each run.
    pub load_share: f64,
    /// Of the map's gradient in ‰, smooth along the line.
    pub map_permille: f64,
    /// Of the map's gradient in ‰, independent for each of its pieces.
    pub survey_permille: f64,
    /// Of the curve constant.
    pub curve_constant_share: f64,
    /// Of the wind of each run's day in m/s.
    pub day_wind_mps: f64,
    /// Of the gusts in m/s, which last about 20 s.
    pub gust_mps: f64,
    /// Mean time in s that forces act after their stamps; drawn from a half to one and a half of it.
    pub force_late_s: f64,
    /// Of the reported traction, and of the reported brake force, in all runs alike.
    pub force_share: f64,
    /// Of both reported forces, from run to run.
    pub run_force_share: f64,
    /// Of the basic resistance, from run to run.
    pub run_resistance_share: f64,
    /// Of the wheel's diameter.
    pub wheel_share: f64,
    /// Mean share of the basic resistance by which cold bearings raise it at the start of a run, a
    /// half to one and a half of it.
    pub warming_share: f64,
    /// Of the rotating-mass factor.
    pub rotating_mass: f64,
    /// Mean length in m over which the line rounds each step of its gradient, a half to one and a half of it.
    pub vertical_curve_m: f64,
    /// Cars on couplings instead of a rigid train: the leading one, which carries the tacho, moves
    /// against the others.
    pub has_couplings: bool,
}

impl TrueDeviations {
    /// Everything is as declared.
    pub const NONE: TrueDeviations = TrueDeviations {
        mass_share: 0.0,
        load_share: 0.0,
        map_permille: 0.0,
        survey_permille: 0.0,
        curve_constant_share: 0.0,
        day_wind_mps: 0.0,
        gust_mps: 0.0,
        force_late_s: 0.0,
        force_share: 0.0,
        run_force_share: 0.0,
        run_resistance_share: 0.0,
        wheel_share: 0.0,
        warming_share: 0.0,
        rotating_mass: 0.0,
        vertical_curve_m: 0.0,
        has_couplings: false,
    };

    /// A good survey, calibrated forces, and the little that differs from run to run.
    pub const PLAIN: TrueDeviations = TrueDeviations {
        survey_permille: 0.05,
        run_force_share: 0.002,
        run_resistance_share: 0.01,
        ..TrueDeviations::NONE
    };

    /// Cars on couplings, and winds: 0.4 m/s, seldom above the least that is an effect.
    pub const COUPLED: TrueDeviations = TrueDeviations {
        has_couplings: true,
        day_wind_mps: 0.4,
        gust_mps: 0.4,
        ..TrueDeviations::PLAIN
    };

    /// Everything a little wrong at once, as on a railway.
    pub const ROUGH: TrueDeviations = TrueDeviations {
        mass_share: 0.02,
        map_permille: 0.12,
        curve_constant_share: 0.15,
        day_wind_mps: 1.3,
        gust_mps: 0.7,
        force_late_s: 0.2,
        force_share: 0.006,
        wheel_share: 0.0015,
        warming_share: 0.05,
        ..TrueDeviations::PLAIN
    };

    /// The same, with deviations that many runs cannot reveal because all runs share them: another rotating mass and
    /// rounded gradients.
    pub const ROUGHER: TrueDeviations =
        TrueDeviations { rotating_mass: 0.004, vertical_curve_m: 80.0, ..TrueDeviations::ROUGH };
}
