//! The line: gradient, curves and tunnels along the chainage.
//!
//! Every property acts along the train's length. Each is kept as a step profile with its cumulative sum, so that the
//! mean over a train costs two look-ups for any number of entries.

mod profile;

pub use profile::{
    GradientError, IntervalValue, LinearProfile, ProfileError, StepProfile, along_line,
};

/// The list of `[track]` that holds curves.
pub const CURVES: &str = "curves";
/// The list of `[track]` that holds tunnels.
pub const TUNNELS: &str = "tunnels";
/// The list of `[track]` that holds [start in m, end in m, extra in N/kN] of places that resist.
pub const RESISTANCE: &str = "resistance";

/// Errors of a surveyed gradient that lie further apart than this in m are independent: integral scale of a process
/// along the line.
pub const GRADIENT_ERROR_FREE_M: f64 = 200.0;

/// Returns the standard deviation of the mean of a gradient's error over a length in m, as a share of that at a point.
pub fn gradient_error_of_mean(length_m: f64) -> f64 {
    (GRADIENT_ERROR_FREE_M / length_m.max(GRADIENT_ERROR_FREE_M)).sqrt()
}

/// Returns the share of a surveyed gradient's error that is still there after a distance in m.
pub fn gradient_error_kept(distance_m: f64) -> f64 {
    (-2.0 * distance_m.abs() / GRADIENT_ERROR_FREE_M).exp()
}

/// Properties of a line besides its profile: by a survey, or from another project's files.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackSurvey {
    /// Gradient for falling chainage as (chainage in m, ‰ climbing positive as the chainage
    /// grows), where trains in that direction take another way.
    pub gradient_falling: Option<StepProfile>,
    /// Standard deviation of the gradient in ‰.
    pub gradient_std_permille: Option<StepProfile>,
    /// Stops: chainage in m and name.
    pub stops: Vec<(f64, String)>,
    /// Permitted speed in m/s; nothing but drawings uses it.
    pub permitted_speed_mps: Option<StepProfile>,
    /// Path of the file that holds the line on the map.
    pub alignment: Option<String>,
    /// The same for falling chainage, where it is another way.
    pub alignment_falling: Option<String>,
}

/// Why a list of track entries is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TrackError {
    /// The gradient list breaks a rule of profiles.
    #[error("gradient: {0}")]
    Gradient(ProfileError),
    /// The list of permitted speeds breaks a rule of profiles.
    #[error("permitted_speed: {0}")]
    PermittedSpeed(ProfileError),
    /// An interval is empty, reversed or not finite.
    #[error(
        "{list} entry {index}: expected start < end, both within a million km, got {start_m} m to \
         {end_m} m"
    )]
    BadInterval {
        /// `curves` or `tunnels`.
        list: &'static str,
        /// Number of the entry, from 1.
        index: usize,
        /// Its start in m.
        start_m: f64,
        /// Its end in m.
        end_m: f64,
    },
    /// A radius is not positive.
    #[error("curves entry {index}: expected a radius above 0 m, got {radius_m} m")]
    BadRadius {
        /// Number of the entry, from 1.
        index: usize,
        /// Its radius in m.
        radius_m: f64,
    },
    /// Two intervals overlap.
    #[error("{list} entry {index} starts at {start_m} m, inside the one that ends at {end_m} m")]
    Overlap {
        /// `curves` or `tunnels`.
        list: &'static str,
        /// Number of the later entry, from 1, by chainage.
        index: usize,
        /// Its start in m.
        start_m: f64,
        /// The end in m of the entry before it.
        end_m: f64,
    },
}

/// A line, as far as it is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Name for people.
    pub name: String,
    /// Length in m, when declared.
    pub length_m: Option<f64>,
    gradient_permille: Option<StepProfile>,
    curvature_per_m: Option<StepProfile>,
    tunnel: Option<TunnelProfiles>,
    curves: Vec<TrackCurve>,
    tunnels: Vec<Tunnel>,
    resistance_n_per_kn: Option<StepProfile>,
    /// How far in m the true gradient lies from the profile, towards growing chainage.
    pub gradient_shift_m: f64,
    /// Error of the declared gradient, when known.
    pub gradient_error: Option<GradientError>,
    /// The sections on which trains weigh more or less than declared.
    pub masses: Vec<MassSection>,
    /// Additions of a survey, or of another project's file.
    pub survey: TrackSurvey,
}

#[derive(Clone, Debug, PartialEq)]
struct TunnelProfiles {
    /// 1 inside a tunnel.
    inside: StepProfile,
    /// The tunnel's length in m inside a tunnel.
    length_m: StepProfile,
}

impl Track {
    /// Returns a line from its lists; a list that is `None` is not known.
    ///
    /// `gradient` holds (chainage in m, ‰ climbing positive as the chainage grows), each
    /// valid until the next.
    ///
    /// # Errors
    ///
    /// When a list is not ordered, has overlapping or reversed intervals, or values that are
    /// not finite.
    pub fn new(
        name: String,
        length_m: Option<f64>,
        gradient: Option<&[(f64, f64)]>,
        curves: Option<Vec<TrackCurve>>,
        tunnels: Option<Vec<Tunnel>>,
    ) -> Result<Self, TrackError> {
        let gradient_permille =
            gradient.map(StepProfile::new).transpose().map_err(TrackError::Gradient)?;
        let curvature_per_m = curves.as_deref().map(curvature_profile).transpose()?;
        let tunnel = tunnels.as_deref().map(tunnel_profiles).transpose()?;
        Ok(Track {
            name,
            length_m,
            gradient_permille,
            curvature_per_m,
            tunnel,
            curves: curves.unwrap_or_default(),
            tunnels: tunnels.unwrap_or_default(),
            gradient_shift_m: 0.0,
            gradient_error: None,
            resistance_n_per_kn: None,
            masses: Vec::new(),
            survey: TrackSurvey::default(),
        })
    }

    /// Returns the line with further resistance in N/kN at places.
    ///
    /// # Errors
    ///
    /// When intervals overlap, are reversed or not finite.
    pub fn with_resistance(mut self, places: &[IntervalValue]) -> Result<Self, TrackError> {
        self.resistance_n_per_kn = Some(interval_profile(RESISTANCE, places)?);
        Ok(self)
    }

    /// Further resistance in N/kN, the mean along a train; `None` when none is known.
    pub fn resistance_n_per_kn(&self, centre_m: f64, train_length_m: f64) -> Option<f64> {
        Some(self.resistance_n_per_kn.as_ref()?.mean_around(centre_m, train_length_m))
    }

    /// True over declared mass at a chainage in a direction of travel.
    pub fn mass_factor(&self, centre_m: f64, direction: f64) -> f64 {
        let holds = |section: &&MassSection| section.holds(centre_m, direction);
        self.masses.iter().filter(holds).map(|section| section.mass_factor).product()
    }

    /// Returns the mean gradient in ‰ under a train, climbing positive as the chainage grows.
    ///
    /// `centre_m` is the chainage of the train's centre. `None` when no gradient is known.
    pub fn gradient_permille(&self, centre_m: f64, train_length_m: f64) -> Option<f64> {
        self.gradient_towards_permille(1.0, centre_m, train_length_m)
    }

    /// Returns the same for a direction of travel, +1 or -1: trains may climb by another way than they
    /// descend.
    pub fn gradient_towards_permille(
        &self,
        direction: f64,
        centre_m: f64,
        train_length_m: f64,
    ) -> Option<f64> {
        let profile = match &self.survey.gradient_falling {
            Some(falling) if direction < 0.0 => falling,
            _ => self.gradient_permille.as_ref()?,
        };
        let true_m = centre_m - self.gradient_shift_m;
        let mapped = profile.mean_around(true_m, train_length_m);
        Some(match &self.gradient_error {
            Some(error) => mapped + error.at(centre_m, direction),
            None => mapped,
        })
    }

    /// Returns the standard deviation in ‰ of the gradient under a train, if a survey states it: see [`gradient_error_kept`].
    pub fn gradient_std_here_permille(&self, centre_m: f64, train_length_m: f64) -> Option<f64> {
        let half_m = 0.5 * train_length_m;
        self.gradient_std_permille(centre_m - half_m, centre_m + half_m)
    }

    /// Returns the standard deviation in ‰ of the mean gradient over an interval, as a survey states it: errors further
    /// apart than [`GRADIENT_ERROR_FREE_M`] are their own. `None` when it is not stated.
    pub fn gradient_std_permille(&self, from_m: f64, to_m: f64) -> Option<f64> {
        let length_m = to_m - from_m;
        let profile = self.survey.gradient_std_permille.as_ref()?;
        let std = profile.mean_around(0.5 * (from_m + to_m), length_m);
        Some(std * gradient_error_of_mean(length_m))
    }

    /// Returns whether both directions have one gradient profile.
    pub fn is_one_profile(&self) -> bool {
        self.survey.gradient_falling.is_none()
    }

    /// Returns whether a level line is declared, or none: nobody surveyed its gradient.
    pub fn is_level(&self) -> bool {
        let profiles = [self.gradient_permille.as_ref(), self.survey.gradient_falling.as_ref()];
        profiles.into_iter().flatten().all(|profile| profile.entries().all(|(_, it)| it == 0.0))
    }

    /// Returns the mean of 1/R in 1/m along a train; `None` when no curves are known.
    pub fn curvature_per_m(&self, centre_m: f64, train_length_m: f64) -> Option<f64> {
        Some(self.curvature_per_m.as_ref()?.mean_around(centre_m, train_length_m))
    }

    /// Returns the share of the train inside tunnels, 0 to 1; `None` when no tunnels are known.
    pub fn tunnel_share(&self, centre_m: f64, train_length_m: f64) -> Option<f64> {
        Some(self.tunnel.as_ref()?.inside.mean_around(centre_m, train_length_m))
    }

    /// Returns the length in m of the tunnel around the train, weighted by the share of the train inside;
    /// `None` when no tunnels are known.
    pub fn tunnel_length_m(&self, centre_m: f64, train_length_m: f64) -> Option<f64> {
        Some(self.tunnel.as_ref()?.length_m.mean_around(centre_m, train_length_m))
    }

    /// Returns the gradient profile as surveyed, when known.
    pub fn gradient(&self) -> Option<&StepProfile> {
        self.gradient_permille.as_ref()
    }

    /// Returns the known curves, by chainage as declared.
    pub fn curves(&self) -> &[TrackCurve] {
        &self.curves
    }

    /// Returns the known tunnels, as declared.
    pub fn tunnels(&self) -> &[Tunnel] {
        &self.tunnels
    }

    /// Returns the further resistance in N/kN at places, zero elsewhere, when known.
    pub fn resistance(&self) -> Option<&StepProfile> {
        self.resistance_n_per_kn.as_ref()
    }

    /// Returns whether the list of curves is known, be it empty.
    pub fn knows_curves(&self) -> bool {
        self.curvature_per_m.is_some()
    }

    /// Returns whether the list of tunnels is known, be it empty.
    pub fn knows_tunnels(&self) -> bool {
        self.tunnel.is_some()
    }
}

fn curvature_profile(curves: &[TrackCurve]) -> Result<StepProfile, TrackError> {
    for (i, curve) in curves.iter().enumerate() {
        // The reciprocal of a subnormal radius is infinite.
        let is_usable = curve.radius_m.is_finite() && (1.0 / curve.radius_m).is_finite();
        if !(is_usable && curve.radius_m > 0.0) {
            return Err(TrackError::BadRadius { index: i + 1, radius_m: curve.radius_m });
        }
    }
    let bend = |it: &TrackCurve| IntervalValue {
        start_m: it.start_m,
        end_m: it.end_m,
        value: 1.0 / it.radius_m,
    };
    let intervals: Vec<IntervalValue> = curves.iter().map(bend).collect();
    interval_profile(CURVES, &intervals)
}

fn tunnel_profiles(tunnels: &[Tunnel]) -> Result<TunnelProfiles, TrackError> {
    let with = |value: fn(&Tunnel) -> f64| -> Vec<IntervalValue> {
        let interval =
            |it: &Tunnel| IntervalValue { start_m: it.start_m, end_m: it.end_m, value: value(it) };
        tunnels.iter().map(interval).collect()
    };
    Ok(TunnelProfiles {
        inside: interval_profile(TUNNELS, &with(|_| 1.0))?,
        length_m: interval_profile(TUNNELS, &with(|tunnel| tunnel.end_m - tunnel.start_m))?,
    })
}

/// A greater chainage in m cannot be distinguished from its neighbours to the millimetre, nor be meant.
const CHAINAGE_MAX_M: f64 = 1e9;

/// Returns the profile that is zero outside the intervals.
///
/// # Errors
///
/// When intervals overlap, are reversed or not finite; `list` names them.
pub fn interval_profile(
    list: &'static str,
    intervals: &[IntervalValue],
) -> Result<StepProfile, TrackError> {
    for (i, &IntervalValue { start_m, end_m, .. }) in intervals.iter().enumerate() {
        let is_on_earth = |at_m: f64| at_m.abs() <= CHAINAGE_MAX_M;
        if !(is_on_earth(start_m) && is_on_earth(end_m) && start_m < end_m) {
            return Err(TrackError::BadInterval { list, index: i + 1, start_m, end_m });
        }
    }
    let mut ordered = intervals.to_vec();
    ordered.sort_by(|one, other| one.start_m.total_cmp(&other.start_m));
    let mut steps: Vec<(f64, f64)> = vec![(f64::MIN, 0.0)];
    for (i, &IntervalValue { start_m, end_m, value }) in ordered.iter().enumerate() {
        let last = steps.len() - 1;
        let (free_from, _) = steps[last];
        if start_m < free_from {
            return Err(TrackError::Overlap { list, index: i + 1, start_m, end_m: free_from });
        }
        if start_m == free_from {
            steps[last].1 = value;
        } else {
            steps.push((start_m, value));
        }
        steps.push((end_m, 0.0));
    }
    // The first entry only opens the profile; the profile itself extends it to the left.
    if steps.len() > 1 {
        steps[0].0 = steps[1].0 - 1.0;
    } else {
        steps[0].0 = 0.0;
    }
    Ok(StepProfile::new(&steps).expect("ordered, finite steps"))
}

#[cfg(test)]
mod tests;

/// A curve of the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackCurve {
    /// Chainage in m where it starts.
    pub start_m: f64,
    /// Chainage in m where it ends.
    pub end_m: f64,
    /// Radius in m.
    pub radius_m: f64,
}

/// A tunnel of the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tunnel {
    /// Chainage in m of the lower portal.
    pub start_m: f64,
    /// Chainage in m of the upper portal.
    pub end_m: f64,
}

/// A section between stations on which trains in one direction weigh more or less than declared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassSection {
    /// Chainage in m where it starts.
    pub from_m: f64,
    /// Chainage in m where it ends.
    pub to_m: f64,
    /// Direction of travel, +1 or -1.
    pub direction: f64,
    /// True over declared mass.
    pub mass_factor: f64,
}

impl MassSection {
    /// Returns whether a chainage in m in a direction of travel lies within.
    #[inline]
    pub fn holds(&self, centre_m: f64, direction: f64) -> bool {
        self.direction == direction && (self.from_m..self.to_m).contains(&centre_m)
    }
}
