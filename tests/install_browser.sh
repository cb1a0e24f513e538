#!/bin/sh
# Installs the browser in which the tests open the HTML report: Debian's or Ubuntu's chromium.
# Does nothing where one is found.
set -eu

for name in chromium chromium-browser google-chrome google-chrome-stable; do
    if command -v "$name" >/dev/null 2>&1; then
        exit 0
    fi
done

if ! command -v apt-get >/dev/null 2>&1; then
    echo "install_browser.sh: no chromium found and no apt-get to install it with:" \
        "install Chromium or Google Chrome by hand" >&2
    exit 1
fi

as_root=
if [ "$(id -u)" -ne 0 ]; then
    if ! command -v sudo >/dev/null 2>&1 || ! sudo -n true 2>/dev/null; then
        echo "install_browser.sh: no chromium found; as root, run" \
            "'apt-get install --no-install-recommends chromium'" >&2
        exit 1
    fi
    as_root="sudo -n"
fi

# Another apt-get may be at work: wait for it.
options="-o DPkg::Lock::Timeout=300 -q"
export DEBIAN_FRONTEND=noninteractive
if ! { $as_root apt-get $options update &&
    $as_root apt-get $options install -y --no-install-recommends chromium; } >&2; then
    echo "install_browser.sh: apt-get could not install chromium (see above)" >&2
    exit 1
fi
