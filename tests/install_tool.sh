#!/bin/sh
# Installs Debian's or Ubuntu's PACKAGE where none of the programs NAME is found.
# usage: install_tool.sh PACKAGE NAME...
set -eu

package=$1
shift
for name in "$@"; do
    if command -v "$name" >/dev/null 2>&1; then
        exit 0
    fi
done

if ! command -v apt-get >/dev/null 2>&1; then
    echo "install_tool.sh: no $1 found and no apt-get to install $package with: install it by hand" >&2
    exit 1
fi

as_root=
if [ "$(id -u)" -ne 0 ]; then
    if ! command -v sudo >/dev/null 2>&1 || ! sudo -n true 2>/dev/null; then
        echo "install_tool.sh: no $1 found; as root, run" \
            "'apt-get install --no-install-recommends $package'" >&2
        exit 1
    fi
    as_root="sudo -n"
fi

# Another apt-get may be at work: wait for it.
options="-o DPkg::Lock::Timeout=300 -q"
export DEBIAN_FRONTEND=noninteractive
if ! { $as_root apt-get $options update &&
    $as_root apt-get $options install -y --no-install-recommends "$package"; } >&2; then
    echo "install_tool.sh: apt-get could not install $package (see above)" >&2
    exit 1
fi
