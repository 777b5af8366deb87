# Every published crate. The command is built from the packed crates alone, as it will be from a registry.
make() {
    bash .ci/package.sh --list
    mkdir -p "$out/crates"
    cp "$target"/package/*-"$version".crate "$out/crates/"
    for file in "$out"/crates/*.crate; do made "$file"; done
}
check() {
    local file name patches=()
    mkdir -p "$clean/crates" "$clean/work"
    for file in "$out"/crates/*-"$version".crate; do
        tar -xzf "$file" -C "$clean/crates"
        name=$(basename "$file" "-$version.crate")
        # The registry's place is taken by the unpacked crates.
        [ "$name" = stylet ] || patches+=(--config "patch.crates-io.$name.path='$clean/crates/$name-$version'")
    done
    cargo build --release --manifest-path "$clean/crates/stylet-$version/Cargo.toml" --features "$features" "${patches[@]}"
    hash_is "$(hash_of_command "$clean/work" "$target/release/stylet")"
    installed "$(ls "$out"/crates | wc -l) crates, unpacked and built without the repository"
}
