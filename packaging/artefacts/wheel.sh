# Wheel for every CPython from 3.10 on (abi3). maturin names the oldest manylinux that the symbols of the build allow.
make() {
    "$python" -m maturin build --release --locked --manifest-path crates/python/Cargo.toml --out "$clean/wheel"
    cp "$clean"/wheel/*.whl "$out/"
    made "$out/$(basename "$clean"/wheel/*.whl)"
}
check() {
    python3 -m venv "$clean/env"
    "$clean/env/bin/pip" install --quiet --disable-pip-version-check "$clean"/wheel/*.whl
    (cd "$clean" && hash_is "$("$clean/env/bin/python" "$root/packaging/python_hash.py" "$root/scenarios/three_layers.ron")")
    installed "pip, in an empty environment of $(python3 --version): $(basename "$clean"/wheel/*.whl)"
}
