#!/usr/bin/env bash
# Builds the controllers in C and C++ with CMake from nothing but the Debian package: shared and
# static.
# CMake is that of PyPI, in an environment of its own, where there is none.
# Build first: cargo build --release --workspace
set -euo pipefail
cd "$(dirname "$0")/.."

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake=$(command -v cmake || true)
if [ -z "$cmake" ]; then
    python3 -m venv "$work/python"
    "$work/python/bin/pip" install --quiet cmake
    cmake=$work/python/bin/cmake
fi

package=$(config/debian/build.sh --out "$work")
dpkg-deb -x "$package" "$work/root"
mkdir "$work/source"
cp client/examples/controller.c client/examples/controller.cpp "$work/source"
cat >"$work/source/CMakeLists.txt" <<'END'
cmake_minimum_required(VERSION 3.16)
project(controller C CXX)
set(CMAKE_CXX_EXTENSIONS OFF)
add_compile_options(-Wall -Wextra -Werror)
find_package(dynocar 0.1 REQUIRED)
foreach(kind client client_static)
    add_executable(${kind} controller.c)
    target_link_libraries(${kind} PRIVATE dynocar::${kind})
    foreach(standard 17 20)
        add_executable(${kind}_cpp${standard} controller.cpp)
        target_compile_features(${kind}_cpp${standard} PRIVATE cxx_std_${standard})
        target_link_libraries(${kind}_cpp${standard} PRIVATE dynocar::${kind})
    endforeach()
endforeach()
END
"$cmake" -S "$work/source" -B "$work/build" -Ddynocar_DIR="$work/root/usr/lib/cmake/dynocar" >"$work/log" ||
    { cat "$work/log"; exit 1; }
"$cmake" --build "$work/build"
for kind in client{,_static}{,_cpp17,_cpp20}; do
    # Without a daemon the example says so and goes on driving: it only has to start.
    status=0
    timeout 2 "$work/build/$kind" >"$work/out" 2>&1 || status=$?
    [ "$status" = 124 ] || [ "$status" = 0 ] || { cat "$work/out"; echo "$kind: exit status $status"; exit 1; }
    [ -s "$work/out" ] || { echo "$kind said nothing"; exit 1; }
    echo "$kind: $(head -n 1 "$work/out")"
done
