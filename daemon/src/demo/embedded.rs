//! The recorded runs that the program carries.

use std::path::Path;

/// The demo's dataset: file name and text.
const FILES: [(&str, &str); 7] = [
    ("dataset.toml", include_str!("../../../config/demo/dataset.toml")),
    ("train.toml", include_str!("../../../config/demo/train.toml")),
    ("track.toml", include_str!("../../../config/demo/track.toml")),
    ("runs/01.csv", include_str!("../../../config/demo/runs/01.csv")),
    ("runs/02.csv", include_str!("../../../config/demo/runs/02.csv")),
    ("runs/03.csv", include_str!("../../../config/demo/runs/03.csv")),
    ("runs/06.csv", include_str!("../../../config/demo/runs/06.csv")),
];

/// Writes the dataset into a folder.
///
/// # Errors
///
/// When a file cannot be written.
pub fn write_dataset(folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder.join("runs"))?;
    FILES.iter().try_for_each(|(name, text)| std::fs::write(folder.join(name), text))
}

/// The demo's daemon configuration.
pub const DAEMON_CONFIG: &str = include_str!("../../../config/daemon.toml");
