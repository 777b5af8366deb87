# Container image, from its Containerfile.
make() {
    cp packaging/Containerfile "$out/Containerfile"
    made "$out/Containerfile"
    local engine
    for engine in podman docker; do
        # Installed, and able to work: a docker without its daemon is not.
        if command -v $engine >/dev/null 2>&1 && $engine info >/dev/null 2>&1; then echo $engine >"$note/engine"; fi
    done
    [ -s "$note/engine" ] || skip "neither podman nor a docker whose daemon runs"
    # Only what is in the commit, without the target folder.
    mkdir "$clean/source"
    git archive HEAD | tar -x -C "$clean/source"
    "$(cat "$note/engine")" build -f packaging/Containerfile -t "stylet:$version" "$clean/source"
}
check() {
    local engine
    engine=$(cat "$note/engine")
    mkdir -p "$clean/work"
    cp scenarios/three_layers.ron "$clean/work/"
    run() { "$engine" run --rm --user "$(id -u):$(id -g)" -v "$clean/work:/work" "stylet:$version" "$@"; }
    run run three_layers.ron --out run
    run enhance run/recording.csv --out enhanced
    hash_is "$(python3 packaging/enhanced_hash.py "$clean/work/enhanced/enhanced.csv")"
    installed "built and run by $engine"
}
