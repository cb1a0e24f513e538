#!/usr/bin/env bash
# Makes the pictures of the documentation anew from simulated datasets: the worked example of
# docs/explain.md, the screenshot of a report, and what commands print. Look at them before you
# commit them. DYNOCAR_PROGRAMS names a folder of programs that were built already.
set -euo pipefail
cd "$(dirname "$0")/.."

tests/install_browser.sh
for name in chromium chromium-browser google-chrome google-chrome-stable; do
  browser=$(command -v "$name") && break
done
if [ -z "${DYNOCAR_PROGRAMS:-}" ]; then
  cargo build --release --workspace
fi
programs=${DYNOCAR_PROGRAMS:-${CARGO_TARGET_DIR:-target}/release}
place=$(mktemp -d)
daemon=
trap '[ -z "$daemon" ] || kill -INT "$daemon"; rm -rf "$place"' EXIT
export DYNOCAR_ROOT=$place/root XDG_STATE_HOME=$place/state
mkdir "$DYNOCAR_ROOT" "$XDG_STATE_HOME"

# What a command prints, as docs/images/NAME.svg, under the words that a reader types.
terminal() {
  name=$1 words=$2
  shift 2
  "$@" > "$place/$name.txt"
  python3 tests/terminal_picture.py "$words" < "$place/$name.txt" > "docs/images/$name.svg"
}

"$programs/dynocar-bench" explain --kind local_resistance --kind tunnel_drag \
  --seeds 1 --first-seed 9001 --threads 1 --write "$place"
"$programs/dynocar" explain "$place/local_resistance-9001" --plots "$place/plots"
cp "$place/plots/speed_run_4.svg" docs/images/example_speed.svg
cp "$place/plots/residual_by_chainage.svg" docs/images/example_residual.svg
cp "$place/plots/errors_holdout.svg" docs/images/example_errors.svg
cp "$place/plots/line.svg" docs/images/example_line.svg

"$programs/dynocar" explain "$place/tunnel_drag-9001" --report "$place/report.html"
"$browser" --headless --no-sandbox --disable-gpu --hide-scrollbars --window-size=940,540 \
  --screenshot="$place/report.png" "file://$place/report.html" 2> "$place/browser.txt"
cp "$place/report.png" docs/explain_report.png

terminal terminal_help "dynocar --help" "$programs/dynocar" --help
terminal terminal_check "dynocar check config/demo" "$programs/dynocar" check config/demo

"$programs/dynocar" run --config config/daemon.toml > "$place/daemon.txt" 2>&1 &
daemon=$!
"$programs/dynocar" replay config/demo --run 1 --rate 100
terminal terminal_health "dynocar health" "$programs/dynocar" health
