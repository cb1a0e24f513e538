//! The daemon's numbers as OpenMetrics text, taken from its snapshots, as every observer takes them.

use dynocar_client::Reading;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{Parameter, PipelineKind, Quantity, Reason, RejectionReason, Status};
use dynocar_transport::monotonic_now_ns;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::Registry;
use std::sync::atomic::AtomicU64;

use super::health::Verdict;
use crate::observing::{ObservedTrain, sample_age_s};
use crate::operator::Suspicion;
use crate::shadow::{Pinned, TrialFigures};

/// The content type of [`text`].
pub const CONTENT_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

type Labels = Vec<(&'static str, String)>;
type Gauges = Family<Labels, Gauge<f64, AtomicU64>>;
type Counters = Family<Labels, Counter>;

/// Declares the families of one answer: each with its name without the prefix and its help.
macro_rules! families {
    ($( $of:ident { $( $member:ident = $name:literal $help:literal; )* } )*) => {
        #[derive(Default)]
        struct Families { $( $( $member: $of, )* )* }

        impl Families {
            /// Names, each with the type of its family.
            #[cfg(test)]
            const NAMES: &[(&str, &str)] = &[ $( $( ($name, stringify!($of)), )* )* ];

            fn register(&self, registry: &mut Registry) {
                $( $( registry.register($name, $help, self.$member.clone()); )* )*
            }
        }
    };
}

families! {
    Counters {
        used = "samples_used" "Samples that entered the estimate";
        rejected = "samples_rejected" "Samples refused, by reason";
        lost = "samples_lost" "Samples that never arrived";
        updates = "updates" "Windows or segments that updated the estimate";
        resets = "resets" "Resets of the estimate";
        maintenance = "maintenance_events" "Maintenance events, by kind";
    }
    Gauges {
        status = "status" "1 for the status that holds";
        usable = "quantity_usable" "1 while a controller may use the quantity that the pipeline answers";
        use_state = "quantity_use" "1 for the state of use that holds, and why";
        vouched_age = "vouched_age_seconds" "Time since the snapshot was vouched for";
        sample_age = "sample_age_seconds" "Time since the newest sample was published; grows while the controller sends none";
        latency = "latency_seconds" "From sample to snapshot, the newest";
        value = "parameter_value" "Value in the parameter's unit";
        deviation = "parameter_std" "Standard deviation in the parameter's unit";
        innovation = "innovation_mean_square" "1 when the model holds";
        unexplained = "unexplained_force_newtons" "Force that the model lacks";
        suspected = "suspected_seconds" "How long the effect has been suspected";
        attention = "attention" "1 where a person is wanted, 0 where not, with the reason";
        in_force = "model_in_force" "1 for the model in force, 0 for one on trial";
        trial_error = "model_error_mps" "Open-loop error of the model over 60 s";
        trial_ratio = "model_error_ratio" "Error of the model over that of the one in force: ends of an interval of 95 %";
        trial_evidence = "model_evidence" "Evidence that the model is better";
        trial_trips = "model_trips" "Trips over which the model was compared";
    }
}

impl Families {
    fn take_trial(&self, it: &TrialFigures) {
        let labels: Labels = vec![("train", it.train.to_string()), ("model", it.model.to_string())];
        self.in_force.get_or_create(&labels).set(f64::from(u8::from(it.is_in_force)));
        if let Some(error_mps) = it.error_mps {
            self.trial_error.get_or_create(&labels).set(error_mps);
        }
        if it.is_in_force {
            return;
        }
        for (end, value) in ["low", "high"].into_iter().zip(it.error_ratio.into_iter().flatten()) {
            let mut labels = labels.clone();
            labels.push(("end", end.to_owned()));
            self.trial_ratio.get_or_create(&labels).set(value);
        }
        self.trial_evidence.get_or_create(&labels).set(it.e_value);
        self.trial_trips.get_or_create(&labels).set(it.trips as f64);
    }

    fn take(&self, reading: &Reading<'_>, name: &str) {
        let it = reading.snapshot;
        let labels: Labels = vec![
            ("train", it.train_id.to_string()),
            ("pipeline", name.to_owned()),
            ("kind", it.pipeline_kind().map_or("unknown", PipelineKind::name).to_owned()),
        ];
        let with = |key: &'static str, value: &str| {
            let mut labels = labels.clone();
            labels.push((key, value.to_owned()));
            labels
        };
        self.used.get_or_create(&labels).inc_by(it.samples_used);
        self.lost.get_or_create(&labels).inc_by(it.samples_lost);
        self.updates.get_or_create(&labels).inc_by(it.updates);
        self.resets.get_or_create(&labels).inc_by(it.generation);
        for &reason in RejectionReason::ALL.iter().filter(|&&reason| it.rejected(reason) > 0) {
            let labels = with("reason", reason.name());
            self.rejected.get_or_create(&labels).inc_by(u64::from(it.rejected(reason)));
        }
        for &status in Status::ALL {
            let holds = f64::from(u8::from(status == reading.status()));
            self.status.get_or_create(&with("status", status.name())).set(holds);
        }
        for &quantity in Quantity::ALL.iter().filter(|&&quantity| it.answers(quantity)) {
            let asked = Reading { quantity: Some(quantity), ..*reading };
            let mut labels = with("quantity", quantity.name());
            self.usable.get_or_create(&labels).set(f64::from(u8::from(asked.is_usable())));
            labels.extend([("use", asked.use_state().name().to_owned())]);
            labels.extend([("why", asked.why().to_owned())]);
            self.use_state.get_or_create(&labels).set(1.0);
        }
        self.vouched_age.get_or_create(&labels).set(reading.age_ns as f64 * 1e-9);
        let now_ns = it.vouched_ns.saturating_add(reading.age_ns);
        if let Some(age_s) = sample_age_s(it, now_ns) {
            self.sample_age.get_or_create(&labels).set(age_s);
            let latency_ns = it.published_ns.saturating_sub(it.sample_published_ns);
            self.latency.get_or_create(&labels).set(latency_ns as f64 * 1e-9);
        }
        self.innovation.get_or_create(&labels).set(it.innovation_mean_square);
        self.unexplained.get_or_create(&labels).set(it.unexplained_force_n);
        let suspicion = Suspicion::from_snapshot(it);
        if suspicion.is_some() || it.pipeline_kind() == Some(PipelineKind::ResidualMonitor) {
            let effect =
                suspicion.map_or("none", |it| it.effect.map_or("unknown", EffectKind::name));
            let age_s = suspicion.map_or(0, |it| it.age_s);
            self.suspected.get_or_create(&with("effect", effect)).set(f64::from(age_s));
        }
        let is_wanted = Verdict::new(reading.status(), reading.reason()) != Verdict::Ok;
        let labels = with("reason", reading.reason().map_or("unknown", Reason::name));
        self.attention.get_or_create(&labels).set(f64::from(u8::from(is_wanted)));
        for (index, number) in it.parameters.iter().enumerate().take(it.parameter_count as usize) {
            let name = Parameter::from_number(*number).map_or("unknown", Parameter::name);
            let labels = with("parameter", name);
            self.value.get_or_create(&labels).set(it.values[index]);
            let deviation = it.covariance_at(index, index).max(0.0).sqrt();
            self.deviation.get_or_create(&labels).set(deviation);
        }
    }
}

/// Returns the newest snapshots and the figures of models on trial, as OpenMetrics text; `names` are the pipelines' by
/// their number.
pub fn text(trains: &mut [ObservedTrain], names: &[String], pinned: &Pinned) -> String {
    let families = Families::default();
    pinned.models.iter().for_each(|it| families.take_trial(it));
    for it in &pinned.events {
        let labels: Labels = vec![("train", it.train.to_string()), ("kind", it.kind.clone())];
        families.maintenance.get_or_create(&labels).inc_by(it.count);
    }
    for train in trains {
        train.poll();
        for reading in train.readings(monotonic_now_ns()) {
            let index = reading.snapshot.pipeline_index as usize;
            families.take(&reading, names.get(index).map_or("unnamed", String::as_str));
        }
    }
    let mut registry = Registry::with_prefix("dynocar");
    families.register(&mut registry);
    let mut text = String::new();
    // Writing into a String cannot fail.
    let _ = encode(&mut text, &registry);
    text
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use dynocar_shared::ParameterSnapshot;

    use super::*;

    /// Returns the metrics that a file of the project names.
    fn named(file: &str) -> BTreeSet<String> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file);
        let text = std::fs::read_to_string(path).expect("a file of the project");
        let is_part = |it: char| it.is_ascii_alphanumeric() || it == '_';
        let words = text.split(|it| !is_part(it)).filter_map(|it| it.strip_prefix("dynocar_"));
        words.map(str::to_owned).collect()
    }

    #[test]
    fn every_metric_that_alerts_and_dashboard_name_is_given_and_the_dashboard_names_all() {
        let full_name = |&(name, of): &(&str, &str)| match of {
            "Counters" => format!("{name}_total"),
            _ => name.to_owned(),
        };
        let given: BTreeSet<String> = Families::NAMES.iter().map(full_name).collect();
        let alerts = named("config/live/prometheus_alerts.yml");
        let shown = named("config/live/grafana_dashboard.json");
        let told = named("docs/guides/off_board.md");
        for names in [&alerts, &told] {
            assert!(names.len() > 4 && names.is_subset(&given), "{names:?}");
        }
        assert!(shown.is_subset(&given), "{shown:?}");
        let hidden: Vec<_> = given.difference(&shown).collect();
        // Models on trial have pages of their own.
        let is_trial = |it: &&&String| it.starts_with("model_") || it.starts_with("maintenance_");
        assert_eq!(hidden.iter().filter(|it| !is_trial(it)).count(), 0, "{hidden:?}");
    }

    /// Returns the metrics of one snapshot.
    fn text_of(snapshot: &ParameterSnapshot, is_stale: bool) -> String {
        let families = Families::default();
        families.take(&Reading { snapshot, age_ns: 0, is_stale, quantity: None }, "one");
        let mut registry = Registry::with_prefix("dynocar");
        families.register(&mut registry);
        let mut text = String::new();
        encode(&mut text, &registry).unwrap();
        text
    }

    fn has(text: &str, name: &str, label: &str, value: &str) -> bool {
        text.lines().any(|it| {
            it.starts_with(name) && it.contains(label) && it.ends_with(&format!("}} {value}"))
        })
    }

    #[test]
    fn a_suspect_and_a_wanted_person_are_labelled() {
        let mut snapshot = ParameterSnapshot::empty();
        snapshot.status = Status::Degraded as u32;
        snapshot.reason = Reason::InnovationsNotWhite as u32;
        snapshot.suspected_effect = EffectKind::DraggingBrake as u32;
        snapshot.suspicion_age_s = 23;
        let text = text_of(&snapshot, false);
        assert!(
            has(&text, "dynocar_suspected_seconds", "effect=\"dragging_brake\"", "23.0"),
            "{text}"
        );
        assert!(
            has(&text, "dynocar_attention", "reason=\"innovations_not_white\"", "1.0"),
            "{text}"
        );
    }

    #[test]
    fn the_pipeline_that_answers_is_named_with_what_a_controller_may_use() {
        let mut snapshot = ParameterSnapshot::empty();
        snapshot.status = Status::Estimated as u32;
        snapshot.quantities = Quantity::Resistance.bit() | Quantity::Mass.bit();
        snapshot.usable_quantities = Quantity::Mass.bit();
        let shown = |is_stale| {
            let text = text_of(&snapshot, is_stale);
            Quantity::ALL
                .iter()
                .map(|it| format!("quantity=\"{it}\""))
                .map(|label| {
                    ["1.0", "0.0"].map(|it| has(&text, "dynocar_quantity_usable", &label, it))
                })
                .collect::<Vec<_>>()
        };
        assert_eq!(Quantity::ALL[..2], [Quantity::Resistance, Quantity::Mass]);
        assert_eq!(shown(false)[..2], [[false, true], [true, false]]);
        assert_eq!(shown(true)[..2], [[false, true]; 2], "nobody may use what nobody vouches for");
        let text = text_of(&snapshot, false);
        let held_back = "quantity=\"resistance\",use=\"confirming\",why=\"confirming\"";
        assert!(has(&text, "dynocar_quantity_use", held_back, "1.0"), "{text}");
        assert!(shown(false)[2..].iter().all(|it| *it == [false; 2]), "others answer these");
    }
}
