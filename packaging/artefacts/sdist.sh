# Source distribution of the Python package.
make() {
    "$python" -m maturin sdist --manifest-path crates/python/Cargo.toml --out "$clean/sdist"
    cp "$clean"/sdist/*.tar.gz "$out/"
    made "$out/$(basename "$clean"/sdist/*.tar.gz)"
}
check() {
    python3 -m venv "$clean/env"
    # In a target folder of its own: Cargo knows workspace members by their path below the root, and would take the repository's objects
    # for those of the unpacked sources.
    CARGO_TARGET_DIR="$clean/target" "$clean/env/bin/pip" install --quiet --disable-pip-version-check "$clean"/sdist/*.tar.gz
    (cd "$clean" && hash_is "$("$clean/env/bin/python" "$root/packaging/python_hash.py" "$root/scenarios/three_layers.ron")")
    installed "pip, compiled in an empty environment"
}
