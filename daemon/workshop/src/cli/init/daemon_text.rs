//! `daemon.toml` of a first description.

/// The daemon's configuration as shipped: the recommended set.
const SHIPPED: &str = include_str!("../../../../../config/daemon.toml");
/// Lines of the shipped configuration that are another train's, and what stands instead.
const REPLACED: [(&str, &str); 5] = [
    (
        "# Dynocar's daemon: which trains it serves, and which estimators learn what.",
        "# Dynocar's daemon: which trains it serves, and which estimators learn what. Written by\n\
         # dynocar init from the recommended set.",
    ),
    (
        "# dynocar check config/daemon.toml says what this file means.",
        "# dynocar check daemon.toml says what this file means.",
    ),
    ("file = \"demo/train.toml\"    # relative", "file = \"train.toml\"         # relative"),
    ("track = \"demo/track.toml\"   # optional", "# track = \"track.toml\"      # optional"),
    (
        "# the train file; the demo's train has neither.",
        "# the train file, table [brake]; add them before you switch it on.",
    ),
];

/// The daemon's configuration: the recommended set for the train beside it.
pub fn daemon(has_track: bool) -> String {
    let text = REPLACED
        .iter()
        .fold(String::from(SHIPPED), |text, (shipped, own)| text.replace(shipped, own));
    if has_track {
        text.replace("# track = \"track.toml\" ", "track = \"track.toml\"   ")
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::train_text::{Found, TrainArguments};
    use dynocar::config::DaemonConfig;

    #[test]
    fn the_configuration_is_the_shipped_one_for_the_train_next_to_it() {
        for (shipped, _) in REPLACED {
            assert_eq!(SHIPPED.matches(shipped).count(), 1, "{shipped}");
        }
        let folder = tempfile::tempdir().unwrap();
        let train = TrainArguments::default().text("x", &Found::default()).unwrap();
        std::fs::write(folder.path().join("train.toml"), train.text).unwrap();
        std::fs::write(folder.path().join("track.toml"), "[track]\n").unwrap();
        let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/daemon.toml");
        let shipped = DaemonConfig::load(std::path::Path::new(shipped)).unwrap();
        for has_track in [false, true] {
            let text = daemon(has_track);
            assert!(!text.contains("demo"), "{text}");
            let path = folder.path().join("daemon.toml");
            std::fs::write(&path, text).unwrap();
            let config = DaemonConfig::load(&path).unwrap();
            assert_eq!(config.pipelines.len(), shipped.pipelines.len());
            assert_eq!(config.trains[0].track.is_some(), has_track);
        }
    }
}
