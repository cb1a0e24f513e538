#!/usr/bin/env bash
# Recordings, read by readers that we did not write: the packages mcap, mcap-protobuf-support, pyarrow and pandas from PyPI. One
# recorder is killed with kill -9, one is asked to end; the daemon, the demo's runs and a replay are real.
set -euo pipefail
cd "$(dirname "$0")/.."

place=$(mktemp -d)
jobs=()
cleanup() {
  for job in "${jobs[@]}"; do kill -9 "$job" 2>/dev/null || true; done
  rm -rf "$place"
}
trap cleanup EXIT
if ! python3 -c 'import ensurepip, venv' 2>/dev/null; then
  # No program is called so: the package is installed.
  tests/install_tool.sh python3-venv python3-venv
fi
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet --disable-pip-version-check mcap==1.6.0 mcap-protobuf-support==0.6.0 \
  pyarrow==26.0.1 pandas==3.1.1

cargo build --release --workspace --bin dynocar --bin dynocar-workshop --bin dynocar-recording
dynocar=${CARGO_TARGET_DIR:-target}/release/dynocar
export DYNOCAR_ROOT=$place/root STATE_DIRECTORY=$place/state

. tests/await.sh

"$dynocar" run --config config/daemon.toml 2>"$place/daemon" &
jobs+=($!)
await "$place/daemon" serving
for name in killed ended; do
  "$dynocar" record -o "$place/$name.mcap" --train 1 2>"$place/$name" &
  jobs+=($!)
  await "$place/$name" "recording into"
done
"$dynocar" replay config/demo --run 1 --rate 50 2>"$place/replay"
# The recorders have a second to take what the replay left in the buffer and to flush it.
sleep 1
kill -9 "${jobs[1]}"
kill -INT "${jobs[2]}"
wait "${jobs[2]}"
"$dynocar" recover "$place/killed.mcap" -o "$place/recovered.mcap" || [ $? -eq 3 ]
for command in check "identify --estimator mass_kalman" "replay --verify"; do
  # shellcheck disable=SC2086
  "$dynocar" $command "$place/recovered.mcap" >"$place/words"
done
"$place/venv/bin/python" tests/recordings.py "$place"

# A learner takes a finished recording up once, and has it when the ring has forgotten it; one whose recorder died it leaves.
mkdir "$place/ring"
cp "$place/ended.mcap" "$place/killed.mcap" "$place/ring"
learn() { # WORDS: what the learner says
  "$dynocar" learn --config config/daemon.toml --runs "$place/ring" --models "$place/models" --once >"$place/learned"
  grep -q "$1" "$place/learned" || { cat "$place/learned"; exit 1; }
}
learn "train 1: 1 run, .* too few runs"
rm "$place/ring/"*
learn "train 1: 1 run, .* nothing new"

# Parquet: to be read by pyarrow; read by our own commands as the recording is; and back.
"$dynocar" convert "$place/ended.mcap" -o "$place/ended.parquet"
"$dynocar" convert "$place/ended.parquet" -o "$place/back.mcap"
same() { # COMMAND: the same words of both, whose names and bytes differ
  # shellcheck disable=SC2086
  "$dynocar" $1 "$place/ended.mcap" >"$place/of_mcap"
  # shellcheck disable=SC2086
  "$dynocar" $1 "$place/ended.parquet" >"$place/of_parquet"
  sed "s/ended.mcap/ended.parquet/g" "$place/of_mcap" | diff - "$place/of_parquet"
}
for command in check "identify --estimator mass_kalman" "replay --verify" explain; do same "$command"; done
"$dynocar" check "$place/ended.parquet/samples-1.parquet" >"$place/words"
"$dynocar" replay "$place/ended.parquet" --run 1 --rate 200 2>"$place/words"

# A dataset whose runs pandas has written says what the same runs as CSV say, in wider columns.
cp -r config/demo "$place/of_pandas"
"$place/venv/bin/python" tests/parquet.py "$place"
sed -i 's/runs\/\(0.\)\.csv/runs\/\1.parquet/; s/^time = .*/time = { column = "time_s", unit = "s" }/' "$place/of_pandas/dataset.toml"
for command in check "identify --estimator mass_kalman" explain; do
  # shellcheck disable=SC2086
  "$dynocar" $command config/demo | sed 's/\.csv/.parquet/g; s#config/demo#DEMO#g' |
    tr -s ' ' >"$place/of_csv"
  # shellcheck disable=SC2086
  "$dynocar" $command "$place/of_pandas" | sed "s#$place/of_pandas#DEMO#g" | tr -s ' ' |
    diff "$place/of_csv" -
done
refused() { # WORDS: what check says of a dataset that is wrong
  if "$dynocar" check "$place/of_pandas" >/dev/null 2>"$place/words"; then
    echo "taken for right, in place of: $1" >&2
    return 1
  fi
  await "$place/words" "$1"
}
cp "$place/wrong.parquet" "$place/of_pandas/runs/01.parquet"
refused "of_pandas/runs/01.parquet: column speed_mps: expected numbers, true and false, or times, found"
head -c 2000 "$place/ended.parquet/events.parquet" >"$place/of_pandas/runs/01.parquet"
refused "of_pandas/runs/01.parquet: not a Parquet file that can be read"
cp "$place/ended.parquet/events.parquet" "$place/of_pandas/runs/01.parquet"
refused "of_pandas/runs/01.parquet:1: unknown column 'time_s'"
rm "$place/of_pandas/runs/01.parquet"
refused "of_pandas/runs/01.parquet: no such file"
