#!/usr/bin/env bash
# Builds the C library and puts header, static and shared library, pkg-config and CMake files under a prefix:
#   crates/capi/install.sh /usr/local
set -euo pipefail
prefix="${1:?where to: crates/capi/install.sh PREFIX}"
cd "$(dirname "$0")/../.."
target="${CARGO_TARGET_DIR:-$PWD/target}"
version=$(cargo metadata --no-deps --format-version 1 | sed 's/.*"name":"stylet-capi","version":"\([^"]*\)".*/\1/')
cargo build --release -p stylet-capi
mkdir -p "$prefix/include" "$prefix/lib/pkgconfig" "$prefix/lib/cmake/Stylet"
prefix=$(cd "$prefix" && pwd)
cp crates/capi/include/stylet.h "$prefix/include/"
cp "$target/release/libstylet.a" "$prefix/lib/"
for shared in "$target"/release/libstylet.so "$target"/release/libstylet.dylib; do
    [ -e "$shared" ] && cp "$shared" "$prefix/lib/"
done
sed "s|@VERSION@|$version|" crates/capi/stylet.pc.in >"$prefix/lib/pkgconfig/stylet.pc"
sed "s|@VERSION@|$version|" crates/capi/cmake/StyletConfigVersion.cmake.in >"$prefix/lib/cmake/Stylet/StyletConfigVersion.cmake"
cp crates/capi/cmake/StyletConfig.cmake "$prefix/lib/cmake/Stylet/"
echo "stylet $version is under $prefix: cc loop.c \$(pkg-config --cflags --libs stylet)"
