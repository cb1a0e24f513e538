#!/usr/bin/env bash
# Licences, sources and duplicates of all dependencies by cargo-deny; known vulnerabilities too where
# the advisory database can be fetched.
set -euo pipefail
cd "$(dirname "$0")/.."

if ! cargo deny --version >/dev/null 2>&1; then
  cargo install cargo-deny --locked --version 0.20.2
fi
cargo deny --log-level error check licenses bans sources
if cargo deny fetch db >/dev/null 2>&1; then
  cargo deny --log-level error check --disable-fetch advisories
else
  echo "advisories: not checked, the database of RustSec cannot be reached from here"
fi
