# Debian package of the command.
. packaging/prefix_tree.sh
deb() { echo "$out/stylet_$version-1_$(dpkg --print-architecture).deb"; }
maintainer="The Stylet developers <noreply@stylet.invalid>"
make() {
    need dpkg-deb
    need dpkg-shlibdeps dpkg-dev
    local tree="$clean/tree" depends
    prefix_tree "$tree/usr"
    mv "$tree/usr/share/doc/stylet/CHANGELOG.md" "$tree/usr/share/doc/stylet/changelog"
    printf 'stylet (%s-1) unstable; urgency=low\n\n  * Release %s; see changelog.gz.\n\n -- %s  %s\n' "$version" "$version" "$maintainer" \
        "$(date -R -u -d "@$commit_time")" >"$tree/usr/share/doc/stylet/changelog.Debian"
    gzip -9n "$tree"/usr/share/man/man1/*.1 "$tree"/usr/share/doc/stylet/changelog*
    # The package's file of that name is what Debian expects; the others are its source.
    rm "$tree"/usr/share/doc/stylet/LICENSE-*
    cat >"$tree/usr/share/doc/stylet/copyright" <<END
Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: stylet

Files: *
Copyright: The Stylet developers
License: Expat or Apache-2.0

License: Expat
$(sed 's/^$/./; s/^/ /' LICENSE-MIT)

License: Apache-2.0
 On Debian systems, the full text is in /usr/share/common-licenses/Apache-2.0.
END
    # The versions of the system's libraries that the command needs, which dpkg-shlibdeps reads from its symbols.
    mkdir -p "$clean/source/debian"
    printf 'Source: stylet\n\nPackage: stylet\nArchitecture: any\n' >"$clean/source/debian/control"
    depends=$(cd "$clean/source" && dpkg-shlibdeps -O "$tree/usr/bin/stylet" | sed -n 's/^shlibs:Depends=//p')
    mkdir "$tree/DEBIAN"
    cat >"$tree/DEBIAN/control" <<END
Package: stylet
Version: $version-1
Architecture: $(dpkg --print-architecture)
Maintainer: $maintainer
Installed-Size: $(du -sk "$tree/usr" | cut -f1)
Depends: $depends
Section: science
Priority: optional
Description: testbed for robot-assisted needle insertion
 Simulates the insertion of a needle into layered tissue, identifies the
 layers online, and explains what a simulation gets wrong when it is compared
 with measured forces. Research software, not a medical device.
END
    (cd "$tree" && find usr -type f -print0 | sort -z | xargs -0 md5sum >DEBIAN/md5sums)
    chmod -R u=rwX,go=rX "$tree"
    SOURCE_DATE_EPOCH=$commit_time dpkg-deb --root-owner-group --build "$tree" "$(deb)"
    made "$(deb)"
    rm -r "$tree"
}
check() {
    mkdir -p "$clean/root/var/lib/dpkg" "$clean/work"
    touch "$clean/root/var/lib/dpkg/status"
    # An empty system has none of the libraries that the package depends on; those are compared with this one's below.
    dpkg --root="$clean/root" --force-not-root --force-depends --force-script-chrootless -i "$(deb)"
    dpkg --root="$clean/root" -s stylet | grep -q "^Status: install ok"
    dpkg-deb -f "$(deb)" Depends
    check_prefix "$clean/root/usr"
    hash_is "$(hash_of_command "$clean/work" env -i "$clean/root/usr/bin/stylet")"
    installed "\`dpkg --root -i\` into an empty folder, run without environment"
}
