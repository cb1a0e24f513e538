//! Tunnels: a resistance by their length (Xie 2019, Jin 2020), and a greater c v² for the part of
//! the train inside.

use dynocar_shared::vocabulary::EffectKind;

use super::{Parameter, Resistance, Suspect};
pub use crate::train::numbers::{
    TUNNEL_C_FACTOR as C_FACTOR, TUNNEL_CONSTANT as CONSTANT, TUNNEL_DC as DC,
};

/// Single-track tunnels reach several times c; the bound is in N/kN per (m/s)².
pub const PARAMETERS: [Parameter; 1] =
    [Parameter::new("dc_n_per_kn_per_mps2", (0.0, DC.rule.range[1]), 1e-5)];
/// A smaller share of c is within the accuracy of tunnel factors, which are tabulated to one decimal.
pub const LEAST_SHARE_OF_C: f64 = 0.1;

/// Adds the resistance of tunnels of a length, weighted by the share of the train inside.
#[inline]
pub fn act_by_length(n_per_kn_m: f64, length_m: Option<f64>, resistance: &mut Resistance) {
    resistance.tunnel_n_per_kn = n_per_kn_m * length_m.unwrap_or(0.0);
}

/// Sets the share of the train inside tunnels; 0 where no tunnel is known.
#[inline]
pub fn enter(share: Option<f64>, resistance: &mut Resistance) {
    resistance.outside = 1.0 - share.unwrap_or(0.0);
}

/// Raises c by a factor for a share of the train.
#[inline]
pub fn act_by_factor(c_factor: f64, share: Option<f64>, resistance: &mut Resistance) {
    resistance.c_share += share.unwrap_or(0.0) * (c_factor - 1.0);
}

/// Adds `dc_n_per_kn_per_mps2` to c for a share of the train.
#[inline]
pub fn act(dc_n_per_kn_per_mps2: f64, share: Option<f64>, resistance: &mut Resistance) {
    resistance.dc += share.unwrap_or(0.0) * dc_n_per_kn_per_mps2;
}

/// Unit: the share of c v² that is added inside.
pub const SUSPECT: Suspect = Suspect {
    is_positive: true,
    ..Suspect::new(EffectKind::TunnelDrag, 1.0, |seen| {
        let mut inside = Resistance::BASIC;
        act_by_factor(2.0, seen.tunnel_share, &mut inside);
        inside.extra_n_per_kn(seen.davis, seen.speed_mps)
    })
};
