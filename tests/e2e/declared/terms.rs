//! Every term that can be declared, with the law that the test compares with the resolver's.

use dynocar_analysis::dataset::{parse_track, parse_train};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{SampleField, TrainSample};

use super::drive::{DELAY_S, Drive, Instant, LAG_S, SPEED_DELAY_S};

/// A train that declares only its true figures, without any of these terms.
pub const TRAIN: &str = "
[train]
mass_t = 90
length_m = 120
rotating_mass_factor = 0.08
[resistance]
a = 1.8
b = 0.02
c = 0.0012
curve_constant_n_per_kn_m = 0
tunnel_constant_n_per_kn_m = 0
[traction]
effort = [[0.0, 120.0], [40.0, 60.0]]
[brake]
max_force_kn = 150
cylinder_diameter_mm = 203
disc_radius_mm = 297
wheel_radius_mm = 460
efficiency = 0.85
ratio = 2.55
friction = 0.28
pads = 24
[corrections]
";

/// Cylinder pressure in Pa of each N of brake force, by the declared gear.
pub const PRESSURE_PA_PER_N: f64 =
    1.0 / (297.0 / 460.0 * std::f64::consts::FRAC_PI_4 * 0.203 * 0.203 * 0.85 * 24.0 * 0.28 * 2.55);

/// A line whose gradient only the samples give.
pub const TRACK: &str = "
[track]
curves = [[1500.0, 2600.0, 400.0], [6200.0, 7000.0, 700.0]]
tunnels = [[3000.0, 3700.0], [8000.0, 9600.0]]
";

/// The gradient that the samples give.
pub const GRADIENT: &str = "
gradient = [[0.0, 2.0], [1200.0, -3.0], [2500.0, 4.5], [4100.0, -1.0], [5600.0, -5.0],
            [7300.0, 3.0], [9000.0, -2.0], [11000.0, 1.0]]
";

/// One declaration with its truth.
pub struct Declaration {
    /// Name in a failure.
    pub name: &'static str,
    /// Replaced text in the train's file, and its replacement.
    pub train: (&'static str, &'static str),
    /// Addition to the line's file.
    pub track: &'static str,
    /// Declared resistance in N/kN; the true slope is less steep by as much, so that the train moves as it did.
    pub extra_n_per_kn: fn(&World, &Instant) -> f64,
    /// How the sample of the same motion differs.
    pub sample: fn(&mut TrainSample, &Instant),
    /// True over declared mass.
    pub mass_factor: f64,
}

/// The train and the line, without any declaration.
pub struct World {
    /// The train.
    pub train: TrainModel,
    /// The line.
    pub track: Track,
}

impl World {
    /// The train and the line of these files.
    pub fn of(train: &str, track: &str) -> Self {
        World {
            train: parse_train("train.toml", train).expect("a train"),
            track: parse_track("track.toml", track).expect("a line"),
        }
    }

    fn tunnel_share(&self, at: &Instant) -> f64 {
        self.track.tunnel_share(at.position_m, self.train.length_m).unwrap_or(0.0)
    }
}

impl Declaration {
    /// The train and line that declare it.
    pub fn world(&self) -> World {
        let (from, to) = self.train;
        assert!(TRAIN.contains(from), "{}: {from}", self.name);
        World::of(&TRAIN.replacen(from, to, 1), &format!("{TRACK}{}", self.track))
    }

    /// The samples of the same motion in which it is true.
    pub fn samples(&self, drive: &Drive, base: &World) -> Vec<TrainSample> {
        let change = |(sample, at): (&TrainSample, &Instant)| {
            let mut sample = *sample;
            let less_steep = at.direction * (self.extra_n_per_kn)(base, at);
            sample.set(SampleField::Gradient, sample.gradient_permille - less_steep);
            (self.sample)(&mut sample, at);
            sample
        };
        drive.samples.iter().zip(&drive.instants).map(change).collect()
    }
}

const NOTHING: Declaration = Declaration {
    name: "nothing",
    train: ("", ""),
    track: "",
    extra_n_per_kn: |_, _| 0.0,
    sample: |_, _| {},
    mass_factor: 1.0,
};

/// Adds a line to `[corrections]`.
const fn correction(line: &'static str) -> (&'static str, &'static str) {
    ("[corrections]\n", line)
}

/// Returns the declarations of a known kind of effect; empty for an effect that belongs to certain runs and is not a
/// property of a train or a line.
pub fn declarations(kind: EffectKind) -> Vec<Declaration> {
    match kind {
        EffectKind::None | EffectKind::DraggingBrake | EffectKind::LowAdhesion => Vec::new(),
        EffectKind::Unknown => unknown(),
        EffectKind::TunnelDrag => tunnel_drag(),
        EffectKind::CurveResistance => curve_resistance(),
        EffectKind::Wind => wind(),
        EffectKind::WheelDiameter => wheel_diameter(),
        EffectKind::GradientShift => gradient_shift(),
        EffectKind::GradientError => gradient_error(),
        EffectKind::MassChange => mass_change(),
        EffectKind::TractionGain => traction_gain(),
        EffectKind::BrakeGain => brake_gain(),
        EffectKind::BrakeDelay => brake_delay(),
        EffectKind::ActuatorDelay => actuator_delay(),
        EffectKind::SpeedDelay => speed_delay(),
        EffectKind::RotatingMass => rotating_mass(),
        EffectKind::BearingTemperature => bearing_temperature(),
        EffectKind::AmbientTemperature => ambient_temperature(),
        EffectKind::LocalResistance => local_resistance(),
    }
}

fn unknown() -> Vec<Declaration> {
    vec![Declaration {
        name: "extra",
        train: correction(
            "[[extra]]\nn_per_kn = 1.2\n[[extra.factor]]\nof = \"speed_mps\"\n\
                 form = \"hyperbola\"\nbelow = 18\nleast = 4\n[[extra.factor]]\n\
                 of = \"ambient_temperature_degc\"\nform = \"above\"\nfrom = -30\nspan = 40\n\
                 [corrections]\n",
        ),
        extra_n_per_kn: |_, at| {
            let slow = (18.0 / at.speed_mps.max(4.0) - 1.0).max(0.0);
            1.2 * slow * (at.degc + 30.0) / 40.0
        },
        ..NOTHING
    }]
}

fn tunnel_drag() -> Vec<Declaration> {
    vec![
        Declaration {
            name: "tunnel_c_factor",
            train: correction("[corrections]\ntunnel_c_factor = 3.0\n"),
            extra_n_per_kn: |world, at| {
                let air = world.train.resistance.c * at.speed_mps.powi(2);
                2.0 * world.tunnel_share(at) * air
            },
            ..NOTHING
        },
        Declaration {
            name: "tunnel_constant",
            train: ("tunnel_constant_n_per_kn_m = 0\n", "tunnel_constant_n_per_kn_m = 0.002\n"),
            extra_n_per_kn: |world, at| {
                let length_m = world.train.length_m;
                0.002 * world.track.tunnel_length_m(at.position_m, length_m).unwrap()
            },
            ..NOTHING
        },
    ]
}

fn curve_resistance() -> Vec<Declaration> {
    vec![Declaration {
        name: "curve_constant",
        train: ("curve_constant_n_per_kn_m = 0\n", "curve_constant_n_per_kn_m = 900\n"),
        extra_n_per_kn: |world, at| {
            900.0 * world.track.curvature_per_m(at.position_m, world.train.length_m).unwrap()
        },
        ..NOTHING
    }]
}

fn wind() -> Vec<Declaration> {
    vec![Declaration {
        name: "wind_plus",
        train: correction("[corrections]\nwind_plus_mps = 7.0\n"),
        extra_n_per_kn: |world, at| {
            let ahead_mps = at.speed_mps + 7.0 * at.direction;
            let air = ahead_mps * ahead_mps.abs() - at.speed_mps.powi(2);
            (1.0 - world.tunnel_share(at)) * world.train.resistance.c * air
        },
        ..NOTHING
    }]
}

fn wheel_diameter() -> Vec<Declaration> {
    vec![Declaration {
        name: "speed_scale",
        train: correction("[corrections]\nspeed_scale = 1.03\n"),
        sample: |sample, _| sample.speed_mps *= 1.03,
        ..NOTHING
    }]
}

fn gradient_shift() -> Vec<Declaration> {
    vec![Declaration {
        name: "gradient",
        track: GRADIENT,
        sample: |sample, _| sample.valid &= !SampleField::Gradient.bit(),
        ..NOTHING
    }]
}

/// The survey, 2 ‰ less steep, and that it lacks them; then the same for each direction.
fn gradient_error() -> Vec<Declaration> {
    vec![
        Declaration {
            name: "gradient_error",
            track: "
                gradient = [[0.0, 0.0], [1200.0, -5.0], [2500.0, 2.5], [4100.0, -3.0],
                            [5600.0, -7.0], [7300.0, 1.0], [9000.0, -4.0], [11000.0, -1.0]]
                gradient_error = [[0.0, 2.0], [5000.0, 2.0], [12000.0, 2.0]]
            ",
            sample: |sample, _| sample.valid &= !SampleField::Gradient.bit(),
            ..NOTHING
        },
        Declaration {
            name: "gradient_error_falling",
            track: "
                gradient = [[0.0, 0.0], [1200.0, -5.0], [2500.0, 2.5], [4100.0, -3.0],
                            [5600.0, -7.0], [7300.0, 1.0], [9000.0, -4.0], [11000.0, -1.0]]
                gradient_falling = [[0.0, 1.0], [1200.0, -4.0], [2500.0, 3.5], [4100.0, -2.0],
                            [5600.0, -6.0], [7300.0, 2.0], [9000.0, -3.0], [11000.0, 0.0]]
                gradient_error = [[0.0, 2.0], [12000.0, 2.0]]
                gradient_error_falling = [[0.0, 1.0], [12000.0, 1.0]]
            ",
            sample: |sample, _| sample.valid &= !SampleField::Gradient.bit(),
            ..NOTHING
        },
    ]
}

fn mass_change() -> Vec<Declaration> {
    vec![Declaration {
        name: "masses",
        track: "masses = [[-1e6, 1e6, 1.0, 1.08], [-1e6, 1e6, -1.0, 1.08]]",
        sample: |sample, _| {
            sample.traction_force_n *= 1.08;
            sample.brake_force_n *= 1.08;
            sample.brake_cylinder_pressure_pa *= 1.08;
        },
        mass_factor: 1.08,
        ..NOTHING
    }]
}

fn traction_gain() -> Vec<Declaration> {
    vec![Declaration {
        name: "traction_gain",
        train: correction("[corrections]\ntraction_gain = 1.07\n"),
        sample: |sample, _| sample.traction_force_n *= 1.07,
        ..NOTHING
    }]
}

fn brake_gain() -> Vec<Declaration> {
    vec![Declaration {
        name: "brake_gain",
        train: correction("[corrections]\nbrake_gain = 1.12\n"),
        sample: |sample, _| sample.brake_force_n *= 1.12,
        ..NOTHING
    }]
}

fn brake_delay() -> Vec<Declaration> {
    vec![Declaration {
        name: "brake_delay",
        train: correction("[corrections]\nbrake_delay_s = 1.0\nbrake_lag_s = 0.6\n"),
        sample: |sample, at| sample.brake_force_n = (-at.commanded_n).max(0.0),
        ..NOTHING
    }]
}

fn actuator_delay() -> Vec<Declaration> {
    assert_eq!((DELAY_S, LAG_S), (1.0, 0.6));
    vec![Declaration {
        name: "actuator_delay",
        train: correction("[corrections]\nactuator_delay_s = 1.0\nactuator_lag_s = 0.6\n"),
        sample: |sample, at| {
            sample.traction_force_n = at.commanded_n.max(0.0);
            sample.brake_force_n = (-at.commanded_n).max(0.0);
        },
        ..NOTHING
    }]
}

fn speed_delay() -> Vec<Declaration> {
    assert_eq!(SPEED_DELAY_S, 0.8);
    vec![Declaration {
        name: "speed_delay",
        train: correction("[corrections]\nspeed_delay_s = 0.8\n"),
        sample: |sample, at| sample.speed_mps = at.late_mps,
        ..NOTHING
    }]
}

fn rotating_mass() -> Vec<Declaration> {
    vec![Declaration {
        name: "rotating_mass_factor",
        train: ("rotating_mass_factor = 0.08\n", "rotating_mass_factor = 0.16\n"),
        extra_n_per_kn: |_, at| 0.08 * at.acceleration_mps2 / 9.81e-3,
        ..NOTHING
    }]
}

fn bearing_temperature() -> Vec<Declaration> {
    vec![Declaration {
        name: "bearing_delta_a",
        train: correction("[corrections]\nbearing_delta_a_n_per_kn = 1.5\nbearing_tau_s = 250.0\n"),
        extra_n_per_kn: |_, at| 1.5 * (-at.time_s / 250.0).exp(),
        ..NOTHING
    }]
}

fn ambient_temperature() -> Vec<Declaration> {
    vec![Declaration {
        name: "ambient_w0",
        train: correction(
            "[corrections]\nambient_w0_per_k = -0.03\nambient_reference_k = 293.15\n",
        ),
        extra_n_per_kn: |world, at| {
            -0.03 * (at.degc - 20.0) * world.train.resistance.w0_n_per_kn(at.speed_mps)
        },
        ..NOTHING
    }]
}

fn local_resistance() -> Vec<Declaration> {
    vec![Declaration {
        name: "resistance",
        track: "resistance = [[-100000.0, 100000.0, 1.0]]",
        extra_n_per_kn: |_, _| 1.0,
        ..NOTHING
    }]
}
