#!/usr/bin/env bash
# Makes the pictures of the documentation anew from simulated datasets: the worked example of
# docs/explain.md, screenshots of pages, and what commands print; and, in target/pictures, what a reader sees of
# README and book. Look at them before you commit them. DYNOCAR_PROGRAMS names a folder of programs that were built
# already.
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

# A page as the browser shows it: FILE, PICTURE, width and height in pixels.
screenshot() {
  "$browser" --headless --no-sandbox --disable-gpu --hide-scrollbars --window-size="$3,$4" \
    --screenshot="$place/page.png" "file://$(realpath "$1")" 2> "$place/browser.txt"
  cp "$place/page.png" "$2"
}

"$programs/dynocar-bench" explain --kind local_resistance --kind tunnel_drag --kind low_adhesion \
  --seeds 1 --first-seed 9001 --threads 1 --write "$place"
"$programs/dynocar" explain "$place/local_resistance-9001" --plots "$place/plots"
cp "$place/plots/speed_run_4.svg" docs/images/example_speed.svg
cp "$place/plots/residual_by_chainage.svg" docs/images/example_residual.svg
cp "$place/plots/errors_holdout.svg" docs/images/example_errors.svg
cp "$place/plots/line.svg" docs/images/example_line.svg

terminal terminal_explain "dynocar explain my_train" "$programs/dynocar" explain "$place/local_resistance-9001"

"$programs/dynocar" explain "$place/tunnel_drag-9001" --report "$place/report.html"
screenshot "$place/report.html" docs/explain_report.png 940 540

# What a model was learned from, in a store of its own.
mkdir "$place/models" "$place/runs"
cp -r "$place/tunnel_drag-9001" "$place/runs/1"
sed "s|demo/train.toml|$place/runs/1/train.toml|; s|demo/track.toml|$place/runs/1/track.toml|" \
  config/daemon.toml > "$place/daemon.toml"
"$programs/dynocar" learn --config "$place/daemon.toml" --runs "$place/runs" --models "$place/models" \
  --once --report "$place/history.html"
screenshot "$place/history.html" docs/images/learn.png 940 640

terminal terminal_help "dynocar --help" "$programs/dynocar" --help
terminal terminal_check "dynocar check config/demo" "$programs/dynocar" check config/demo
terminal terminal_identify "dynocar identify config/demo" "$programs/dynocar" identify config/demo
terminal terminal_stops "dynocar stops metro --from 15" "$programs/dynocar" stops "$place/low_adhesion-9001" --from 15
"$programs/dynocar" check config/demo/track.toml --draw "$place/drawn"
cp "$place/drawn/line.svg" docs/images/line.svg

"$programs/dynocar" run --config config/daemon.toml > "$place/daemon.txt" 2>&1 &
daemon=$!
"$programs/dynocar" record -o "$place/run.mcap" > "$place/record.txt" 2>&1 &
recorder=$!
"$programs/dynocar" replay config/demo --run 1 --rate 100
terminal terminal_health "dynocar health" "$programs/dynocar" health
kill -INT "$recorder" && wait "$recorder" || true
# The recording program may outlive the one that called it by a moment.
sleep 1
terminal terminal_verify "dynocar replay --verify run.mcap" "$programs/dynocar" replay --verify "$place/run.mcap"

mkdir -p target/pictures
tests/book.sh
screenshot target/book/docs/index.html target/pictures/book.png 1200 900
screenshot target/book/index.html target/pictures/readme.png 1200 2400
