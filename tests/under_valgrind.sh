#!/usr/bin/env bash
# Runs the client's unit tests, its C interface given nonsense, and a daemon's and controller's
# ports sending and receiving, under valgrind: any read or write outside memory fails. Values that
# are not initialised are not asked for: optimised code may compare the payload that an enum does
# not have, and throw the answer away. Installs Debian's or Ubuntu's valgrind where there is none.
set -euo pipefail
cd "$(dirname "$0")/.."

command -v valgrind >/dev/null || { apt-get update && apt-get install -y valgrind; }
host=$(rustc -vV | sed -n 's/^host: //p' | tr 'a-z-' 'A-Z_')
export "CARGO_TARGET_${host}_RUNNER=valgrind -q --error-exitcode=9 --leak-check=no --undef-value-errors=no"
cargo test --release -p dynocar-shared --lib
cargo test --release -p dynocar-client --lib --test wrong_arguments
cargo test --release -p dynocar-tests --test no_allocation
