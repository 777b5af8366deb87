# Command, completions, manual pages, scenarios and licences under a prefix: prefix_tree FOLDER. Shared by archive and Debian package.
prefix_tree() {
    local prefix=$1 stylet="$target/release/stylet" shell command
    install -Dm755 -s "$stylet" "$prefix/bin/stylet"
    for shell in bash:bash-completion/completions/stylet zsh:zsh/site-functions/_stylet fish:fish/vendor_completions.d/stylet.fish; do
        "$stylet" completions "${shell%%:*}" | install -Dm644 /dev/stdin "$prefix/share/${shell#*:}"
    done
    "$stylet" man | install -Dm644 /dev/stdin "$prefix/share/man/man1/stylet.1"
    # The commands are the indented words below "Commands:" of the help.
    for command in $("$stylet" --help | sed -n '/^Commands:/,/^Options:/s/^  \([a-z][a-z-]*\) .*/\1/p' | grep -vx help); do
        "$stylet" man "$command" | install -Dm644 /dev/stdin "$prefix/share/man/man1/stylet-$command.1"
    done
    install -Dm644 -t "$prefix/share/doc/stylet" README.md CHANGELOG.md CITATION.cff LICENSE-APACHE LICENSE-MIT NOTICE
    mkdir -p "$prefix/share/stylet"
    git archive HEAD scenarios | tar -x -C "$prefix/share/stylet"
}

# Manual pages without warnings, and completions that bash accepts: check_prefix FOLDER.
check_prefix() {
    local page
    if command -v man >/dev/null 2>&1; then
        for page in "$1"/share/man/man1/*; do
            [ -z "$(MANWIDTH=100 man --warnings -l "$page" 2>&1 >/dev/null)" ] || { echo "man warns about $page"; return 1; }
        done
    fi
    bash -c ". '$1/share/bash-completion/completions/stylet' && complete -p stylet"
}
