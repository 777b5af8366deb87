# Conda package, from its recipe.
make() {
    cp packaging/conda/recipe.yaml "$out/conda-recipe.yaml"
    made "$out/conda-recipe.yaml"
    need rattler-build
    rattler-build build --recipe packaging/conda/recipe.yaml --output-dir "$clean/channel" --no-test
    cp "$clean"/channel/*/stylet-*.conda "$out/"
    made "$(ls "$out"/stylet-*.conda)"
}
check() {
    mkdir -p "$clean/work"
    rattler-build test --package-file "$(ls "$out"/stylet-*.conda)"
    # The package's files do not depend on where they are.
    unzip -q "$out"/stylet-*.conda -d "$clean/package"
    mkdir "$clean/prefix"
    zstd -dc "$clean"/package/pkg-stylet-*.tar.zst | tar -x -C "$clean/prefix"
    hash_is "$(hash_of_command "$clean/work" "$clean/prefix/bin/stylet")"
    installed "built and tested by rattler-build"
}
