# For scripts that wait for what a program in the background says: source it.

await() { # FILE WORDS
  for _ in $(seq 600); do
    if grep -q "$2" "$1"; then return; fi
    sleep 0.1
  done
  echo "waited in vain for '$2' in $1:" >&2
  cat "$1" >&2
  return 1
}
