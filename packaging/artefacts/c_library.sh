# C library: header, static and shared library, pkg-config and CMake files, for any prefix.
make() {
    local tree="$clean/stylet-c-$version-$triple"
    crates/capi/install.sh "$tree"
    strip --strip-debug "$tree/lib/libstylet.a"
    strip --strip-unneeded "$tree/lib/libstylet.so"
    install -Dm644 -t "$tree/share/doc/stylet-c" crates/capi/README.md LICENSE-APACHE LICENSE-MIT NOTICE crates/capi/examples/loop.c
    pack "$tree" "$out/stylet-c-$version-$triple.tar.gz"
    rm -r "$tree"
}
check() {
    need cc "a C compiler"
    local prefix="$clean/prefix" how="unpacked; a C program" flags
    mkdir "$prefix"
    tar -xzf "$out/stylet-c-$version-$triple.tar.gz" --strip-components=1 -C "$prefix"
    consume() { LD_LIBRARY_PATH="$prefix/lib" "$1" <"$recording" | sha256sum | cut -c1-32; }
    if command -v pkg-config >/dev/null 2>&1; then
        export PKG_CONFIG_PATH="$prefix/lib/pkgconfig"
        pkg-config --exact-version="$version" stylet
        # Compiled and linked by one word list, as a user does.
        read -ra flags <<<"$(pkg-config --cflags --libs stylet)"
        cc -std=c11 -Wall -Wextra -Werror -O2 packaging/consumer/consumer.c "${flags[@]}" -o "$clean/by_pkg_config"
        hash_is "$(consume "$clean/by_pkg_config")"
        how="$how by pkg-config"
    fi
    if command -v cmake >/dev/null 2>&1; then
        cmake -S packaging/consumer -B "$clean/build" -DCMAKE_PREFIX_PATH="$prefix" -DSTYLET_VERSION="$version"
        cmake --build "$clean/build"
        hash_is "$(consume "$clean/build/with_shared")"
        # The static one needs no library at run time.
        hash_is "$("$clean/build/with_static" <"$recording" | sha256sum | cut -c1-32)"
        how="$how and by CMake (shared, static)"
    fi
    installed "$how"
}
