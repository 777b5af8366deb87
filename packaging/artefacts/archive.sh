# Archive for any prefix: command, completions, manual pages, scenarios.
. packaging/prefix_tree.sh
make() {
    local tree="$clean/stylet-$version-$triple"
    prefix_tree "$tree"
    pack "$tree" "$out/stylet-$version-$triple.tar.gz"
    rm -r "$tree"
}
check() {
    mkdir "$clean/usr" "$clean/work"
    tar -xzf "$out/stylet-$version-$triple.tar.gz" --strip-components=1 -C "$clean/usr"
    check_prefix "$clean/usr"
    hash_is "$(hash_of_command "$clean/work" env -i "$clean/usr/bin/stylet")"
    installed "unpacked with tar into an empty folder, run without environment"
}
