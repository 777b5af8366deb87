# Wrapper for MATLAB and Octave over the C library: sources, compiled on the user's machine.
make() {
    local tree="$clean/stylet-matlab-$version"
    install -Dm644 -t "$tree" packaging/octave/*.{c,m} LICENSE-APACHE LICENSE-MIT NOTICE
    pack "$tree" "$out/stylet-matlab-$version.tar.gz"
    rm -r "$tree"
}
check() {
    need octave-cli Octave
    need mkoctfile octave-dev
    crates/capi/install.sh "$clean/prefix"
    tar -xzf "$out/stylet-matlab-$version.tar.gz" -C "$clean"
    (cd "$clean/stylet-matlab-$version" && octave-cli --norc --eval "stylet_build('$clean/prefix'); test_stylet('$recording', '$clean/bytes')")
    hash_is "$(sha256sum <"$clean/bytes" | cut -c1-32)"
    installed "unpacked, compiled and run by $(octave-cli --version | head -1 | sed 's/, version//')"
}
