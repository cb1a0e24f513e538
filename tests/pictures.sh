#!/usr/bin/env bash
# Makes the pictures of the documentation anew from simulated datasets: the worked example of
# docs/explain.md and the screenshot of a report. Look at them before you commit them.
set -euo pipefail
cd "$(dirname "$0")/.."

tests/install_browser.sh
for name in chromium chromium-browser google-chrome google-chrome-stable; do
  browser=$(command -v "$name") && break
done
cargo build --release -p dynocar -p dynocar-bench
programs=${CARGO_TARGET_DIR:-target}/release
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT

"$programs/dynocar-bench" explain --kind local_resistance --kind tunnel_drag \
  --seeds 1 --first-seed 9001 --threads 1 --write "$place"
"$programs/dynocar" explain "$place/local_resistance-9001" --plots "$place/plots"
cp "$place/plots/speed_run_4.svg" docs/images/example_speed.svg
cp "$place/plots/residual_by_chainage.svg" docs/images/example_residual.svg
cp "$place/plots/errors_holdout.svg" docs/images/example_errors.svg
cp "$place/plots/line.svg" docs/images/example_line.svg

"$programs/dynocar" explain "$place/tunnel_drag-9001" --report "$place/report.html"
"$browser" --headless --no-sandbox --disable-gpu --hide-scrollbars --window-size=870,655 \
  --screenshot="$place/report.png" "file://$place/report.html" 2> "$place/browser.txt"
cp "$place/report.png" docs/explain_report.png
