#!/bin/sh
# Builds dynocar_<version>_<arch>.deb from the release binaries. dynocar-workshop must lie beside the program;
# dynocar-watch, dynocar-recording and dynocar-live go into it where they do.
# usage: build.sh [--program FILE] [--libraries FOLDER] [--out FOLDER]
#   --program    the program, default target/release/dynocar
#   --libraries  where libdynocar_client.a and libdynocar_fmu.so lie, default target/release
#   --out        where the package goes, default target/debian
# Build first: cargo build --release -p dynocar -p dynocar-workshop -p dynocar-watch -p dynocar-recording -p dynocar-live &&
#              cargo build --release -p dynocar-client -p dynocar-fmu
set -eu

here=$(cd "$(dirname "$0")" && pwd)
project=$(cd "$here/../.." && pwd)
program=$project/target/release/dynocar
libraries=$project/target/release
out=$project/target/debian

fail() {
    echo "build.sh: $*" >&2
    exit 1
}

while [ $# -gt 0 ]; do
    [ $# -ge 2 ] || fail "$1: expected a value"
    case $1 in
    --program) program=$2 ;;
    --libraries) libraries=$2 ;;
    --out) out=$2 ;;
    *) fail "$1: expected --program, --libraries or --out" ;;
    esac
    shift 2
done

name=$(basename "$program")
workshop=$(dirname "$program")/dynocar-workshop${name#dynocar}
for file in "$program" "$workshop" "$libraries/libdynocar_client.a" "$libraries/libdynocar_fmu.so"; do
    [ -f "$file" ] || fail "$file: no such file; build it with cargo build --release"
done
for tool in cc dpkg dpkg-deb gzip; do
    command -v "$tool" >/dev/null || fail "no $tool found"
done

version=$("$program" --version | cut -d ' ' -f 2)
arch=$(dpkg --print-architecture)
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
chmod 755 "$root"
umask 022

put() { # SOURCE TARGET [MODE]
    install -D -m "${3:-644}" "$1" "$root/$2"
}

# The programs, what shells offer for them, and their manual.
put "$program" usr/bin/dynocar 755
put "$workshop" usr/bin/dynocar-workshop 755
for companion in dynocar-watch dynocar-recording dynocar-live; do
    if [ -f "$(dirname "$program")/$companion" ]; then
        put "$(dirname "$program")/$companion" "usr/bin/$companion" 755
    else
        echo "build.sh: no $companion beside the program: the package goes without it" >&2
    fi
done
for file in foxglove_layout.json plotjuggler_layout.xml grafana_dashboard.json prometheus_alerts.yml telegraf.conf; do
    put "$project/config/live/$file" "usr/share/dynocar/live/$file"
done
completions() { # SHELL TARGET
    mkdir -p "$root/$(dirname "$2")"
    "$program" completions "$1" >"$root/$2"
}
completions bash usr/share/bash-completion/completions/dynocar
completions zsh usr/share/zsh/vendor-completions/_dynocar
completions fish usr/share/fish/vendor_completions.d/dynocar.fish
"$program" man --out "$root/usr/share/man/man1" 2>/dev/null
gzip -9n "$root"/usr/share/man/man1/*.1

# What a controller links.
put "$project/client/include/dynocar.h" usr/include/dynocar.h
put "$project/client/include/dynocar.hpp" usr/include/dynocar.hpp
put "$libraries/libdynocar_client.a" usr/lib/libdynocar_client.a
# The shared library bears the interface's version in its name; below 1.0 that is the minor one.
minor=${version#*.} major=${version%%.*}
minor=${minor%%.*}
soname=libdynocar_client.so.$major.$minor
cc -shared -Wl,-soname,"$soname" -Wl,--version-script,"$here/client/exports.map" -Wl,--gc-sections \
    -Wl,--whole-archive "$libraries/libdynocar_client.a" -Wl,--no-whole-archive \
    -lpthread -ldl -lm -lgcc_s -o "$root/usr/lib/$soname"
chmod 644 "$root/usr/lib/$soname"
ln -s "$soname" "$root/usr/lib/libdynocar_client.so"
install_template() { # TEMPLATE TARGET: for those who build with pkg-config or CMake
    mkdir -p "$root/$(dirname "$2")"
    sed -e "s/@VERSION@/$version/" -e "s/@SONAME@/$soname/" -e "s/@MAJOR@/$major/" \
        -e "s/@MINOR@/$minor/" "$here/client/$1" >"$root/$2"
}
install_template dynocar-client.pc usr/lib/pkgconfig/dynocar-client.pc
install_template dynocar-config.cmake usr/lib/cmake/dynocar/dynocar-config.cmake
install_template dynocar-config-version.cmake usr/lib/cmake/dynocar/dynocar-config-version.cmake
put "$libraries/libdynocar_fmu.so" usr/lib/dynocar/libdynocar_fmu.so
if command -v strip >/dev/null; then
    strip --strip-unneeded "$root"/usr/bin/* "$root/usr/lib/$soname" \
        "$root/usr/lib/dynocar/libdynocar_fmu.so"
    strip --strip-debug "$root/usr/lib/libdynocar_client.a"
fi

# The daemon: a configuration to be filled in, and the unit that is not enabled before that.
"$program" init "$root/etc/dynocar" --name "fill in: the train of this host" >/dev/null
unit=usr/lib/systemd/system/dynocar.service
put "$project/config/dynocar.service" "$unit"
sed -i 's|^ExecStart=/usr/local/bin/dynocar |ExecStart=/usr/bin/dynocar |' "$root/$unit"
grep -q '^ExecStart=/usr/bin/dynocar ' "$root/$unit" || fail "config/dynocar.service has no ExecStart"
# Programs beside the daemon: their units, off until they are wanted.
unit_of() { # PROGRAM SOURCE
    [ -f "$root/usr/bin/$1" ] || return 0
    unit=usr/lib/systemd/system/$(basename "$2")
    put "$project/$2" "$unit"
    sed -i 's|^ExecStart=/usr/local/bin/|ExecStart=/usr/bin/|' "$root/$unit"
}
unit_of dynocar-recording config/dynocar-flight-recorder.service
unit_of dynocar-recording config/dynocar-learn.service
put "$here/sysusers.conf" usr/lib/sysusers.d/dynocar.conf

# What goes with it.
document=usr/share/doc/dynocar
put "$here/copyright" "$document/copyright"
put "$project/client/README.md" "$document/client.md"
for guide in "$project"/docs/guides/*.md; do
    put "$guide" "$document/guides/$(basename "$guide")"
done
put "$project/docs/troubles.md" "$document/troubles.md"
put "$project/CHANGELOG.md" "$document/changelog"
gzip -9n "$root/$document/changelog"

# The package's own files. The newest C library that is called for is the oldest that will do.
mkdir "$root/DEBIAN"
glibc=$(grep -aoh 'GLIBC_2\.[0-9]*' "$root"/usr/bin/* "$root/usr/lib/$soname" |
    sed 's/GLIBC_//' | sort -uV | tail -n 1)
size=$(du -sk --exclude=DEBIAN "$root" | cut -f 1)
cat >"$root/DEBIAN/control" <<EOF
Package: dynocar
Version: $version
Architecture: $arch
Maintainer: The Dynocar developers <dynocar@localhost>
Installed-Size: $size
Depends: libc6 (>= ${glibc:-2.31}), libgcc-s1
Recommends: systemd
Section: science
Priority: optional
Description: estimates resistance, mass, adhesion and brakes of a train as it drives
 A dynamometer car in software. A daemon beside a train controller reads its samples from shared
 memory, learns running resistance, mass, adhesion and brake friction, and answers with estimates
 that say how sure they are. On recorded runs it finds the effect that a model of a train lacks.
 .
 The package holds the programs, the daemon's unit, and the library that a controller links, for C
 and C++.
EOF
(cd "$root" && find etc -type f | sort | sed 's|^|/|') >"$root/DEBIAN/conffiles"
(cd "$root" && find usr -type f -exec md5sum {} + | sort -k 2) >"$root/DEBIAN/md5sums"
for script in postinst prerm postrm; do
    put "$here/$script" "DEBIAN/$script" 755
done

mkdir -p "$out"
package=$out/dynocar_${version}_$arch.deb
dpkg-deb --root-owner-group -Zxz -z1 --build "$root" "$package" >/dev/null
echo "$package"
