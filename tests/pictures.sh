#!/usr/bin/env bash
# Makes the pictures of the documentation anew from simulated datasets: the worked example of
# docs/explain.md, screenshots of pages, and what commands print; and, in target/pictures, what a reader sees of
# README and book. Look at them before you commit them. DYNOCAR_PROGRAMS names a folder of programs that were built
# already, DYNOCAR_PYTHON a Python that has dynocar[fleet]; without it the wheel is built and tested.
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
daemon= live=
trap 'for job in $daemon $live; do kill -INT "$job" || true; done; rm -rf "$place"' EXIT
python=${DYNOCAR_PYTHON:-$place/python/bin/python}
if [ -z "${DYNOCAR_PYTHON:-}" ]; then
  tests/python_wheel.sh "$place/wheels"
  python3 -m venv "$place/python"
  "$python" -m pip install --quiet --disable-pip-version-check "$(ls "$place"/wheels/dynocar-*.whl)[fleet]"
fi
. tests/await.sh
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
programs=$(realpath "$programs")
(cd "$place" && "$programs/dynocar" learn --config daemon.toml --runs runs --models models --once \
  --report history.html)
screenshot "$place/history.html" docs/images/learn.png 940 640

"$programs/dynocar-bench" survey --passes 1 --write "$place/raw"
"$programs/dynocar" survey "$place/raw" --out "$place/line" --report "$place/line.html"
screenshot "$place/line.html" docs/images/survey.png 940 1190

# Six trains on a line with an undeclared resistance; train 12 has one of its own, train 13 another mass.
PYTHONPATH=client/python/tests "$python" -B - "$place/fleet" << 'END'
import sys
from pathlib import Path
from fleet_simulator import Truth, write_description, write_parquet_train

fleet, of_line, own = Path(sys.argv[1]), (5000.0, 6500.0, 1.2), (8500.0, 9900.0, 1.5)
days = ["2026-05-03", "2026-05-12", "2026-05-21"]
write_description(fleet)
for number in range(10, 16):
    places = (of_line, own) if number == 12 else (of_line,)
    truth = Truth(places, mass_factor=1.08 if number == 13 else 1.0)
    write_parquet_train(fleet, str(number), days, truth, number)
END
"$python" -m dynocar.fleet explain "$place/fleet" -o "$place/report"
screenshot "$place/report/fleet.html" docs/images/fleet.png 940 796

terminal terminal_help "dynocar --help" "$programs/dynocar" --help
terminal terminal_check "dynocar check config/demo" "$programs/dynocar" check config/demo
terminal terminal_identify "dynocar identify config/demo" "$programs/dynocar" identify config/demo
terminal terminal_stops "dynocar stops metro --from 15" "$programs/dynocar" stops "$place/low_adhesion-9001" --from 15
terminal terminal_brakes "dynocar brakes metro" "$programs/dynocar" brakes "$place/low_adhesion-9001"
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
terminal terminal_verify "dynocar replay --verify run.mcap" env -C "$place" "$programs/dynocar" replay --verify run.mcap

# The browser is a viewer that comes and goes.
"$programs/dynocar" live > "$place/live.txt" 2>&1 &
live=$!
await "$place/live.txt" serving
echo "<script>new WebSocket('ws://127.0.0.1:8765', 'foxglove.sdk.v1')</script>" > "$place/viewer.html"
screenshot "$place/viewer.html" "$place/viewer.png" 400 300
await "$place/live.txt" "a viewer has gone"
terminal terminal_live "dynocar live" cat "$place/live.txt"

mkdir -p target/pictures
tests/book.sh
screenshot target/book/docs/index.html target/pictures/book.png 1200 900
screenshot target/book/index.html target/pictures/readme.png 1200 2400
