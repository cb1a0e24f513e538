#!/usr/bin/env bash
# Runs the unit tests of the transport and the client, its C interface given nonsense, and a daemon's and controller's
# ports sending and receiving, under valgrind: any read or write outside memory fails. Values that
# are not initialised are not asked for: optimised code may compare the payload that an enum does
# not have, and throw the answer away. Installs Debian's or Ubuntu's valgrind where there is none.
set -euo pipefail
cd "$(dirname "$0")/.."

command -v valgrind >/dev/null || { apt-get update && apt-get install -y valgrind; }
# As the workspace's own tests are built, so that nothing is built twice.
programs=$(cargo test --release --workspace --lib --test client --test hot_path --no-run \
  --message-format json | sed -nE 's#.*"executable":"([^"]*/(dynocar_shared|dynocar_transport|dynocar_client|client|hot_path)-[0-9a-f]+)".*#\1#p')
[ "$(echo "$programs" | wc -l)" = 5 ] || { echo "expected five programs of tests, found: $programs" >&2; exit 1; }
for program in $programs; do
  only=()
  case $program in
    */client-*) only=(wrong_arguments::) ;;
    */hot_path-*) only=(no_allocation::) ;;
  esac
  valgrind -q --error-exitcode=9 --leak-check=no --undef-value-errors=no "$program" "${only[@]}"
done
