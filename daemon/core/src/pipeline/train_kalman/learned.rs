//! All that samples teach, and a braking that cannot be explained must not.

use super::bank::MotionBank;
use super::jump_share::JumpShare;
use super::prior::Resistance;
use super::settings::TrainKalmanSettings;
use crate::pipeline::InnovationMonitor;
use crate::pipeline::motion::SpeedNoise;

/// Innovations that the published statistics look back over.
const INNOVATION_MEMORY: u32 = 1000;

/// State, noise and the record of innovations.
#[derive(Clone, Debug)]
pub struct Learned {
    /// The filters.
    pub bank: MotionBank,
    /// Noise of the measured speed.
    pub noise: SpeedNoise,
    /// What forces that jump between two samples contribute.
    pub jumps: JumpShare,
    /// Innovations so far.
    pub monitor: InnovationMonitor,
}

impl Learned {
    /// Before any sample.
    pub fn new(settings: &TrainKalmanSettings, first: &Resistance) -> Self {
        Learned {
            bank: first.bank(settings),
            noise: SpeedNoise::guessed(settings.speed_noise_mps),
            jumps: JumpShare::default(),
            monitor: InnovationMonitor::new(INNOVATION_MEMORY),
        }
    }
}
