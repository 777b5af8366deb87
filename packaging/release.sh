#!/usr/bin/env bash
# Makes every artefact of a release, installs each in a clean place, runs the same scenario with each and compares the results:
#   packaging/release.sh --dry-run OUT [ARTEFACT...]
# OUT gets the artefacts, `table.md` and `logs/`. ARTEFACT is a name of packaging/artefacts; without any, all are made. The exit code
# is 1 when an artefact cannot be made or installed, or gives another result. What needs a program that is not here is reported as
# not tested. Needs a Rust toolchain, a C compiler and Python with venv; cmake, octave-dev, ROS 2, docker or podman, and
# rattler-build test more. The release build in the target folder of Cargo is shared by all but the sdist.
set -euo pipefail
if [ "${1:-}" != --dry-run ] || [ -z "${2:-}" ]; then
    sed -n '2,7s/^# //p' "$0" >&2
    exit 2
fi
mkdir -p "$2/logs"
out=$(cd "$2" && pwd)
shift 2
root=$(cd "$(dirname "$0")/.." && pwd)
cd "$root"
# In the order in which they use each other's results.
all=(archive debian wheel sdist c_library crates fmu octave ros2 conda container)
wanted=("${@:-${all[@]}}")
[ $# = 0 ] && wanted=("${all[@]}")
for name in "${wanted[@]}"; do
    [ -f "packaging/artefacts/$name.sh" ] || { echo "no artefact is called $name; there are: ${all[*]}" >&2; exit 2; }
done

target="${CARGO_TARGET_DIR:-$root/target}"
export CARGO_TARGET_DIR="$target" CARGO_INCREMENTAL=0
# Those of .cargo/config.toml, which packages that are built elsewhere do not see; so that they share the build.
export RUSTFLAGS="-C no-vectorize-slp"
# Time of the files in archives, so that archives of one commit have the same bytes. Not exported as SOURCE_DATE_EPOCH: C libraries
# would be compiled again.
commit_time=$(git log -1 --format=%ct)
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' Cargo.toml)
for file in CITATION.cff packaging/conda/recipe.yaml packaging/ros2/stylet_ros/package.xml; do
    grep -Eq "^ *<?version(: |>)\"?$version\b" "$file" || { echo "$file: has another version than Cargo.toml, $version" >&2; exit 1; }
done
grep -q "stylet-$version-" docs/how-to/install.md || { echo "docs/how-to/install.md: names files of another version than $version" >&2; exit 1; }
triple=$(rustc -vV | sed -n 's/^host: //p')
features=formats,parquet
temporary=$(mktemp -d)
trap 'rm -rf "$temporary"' EXIT

# For the artefacts' `make` and `check`, which run in subshells of their own with errors fatal.
skip() { echo "$1" >"$note/skipped"; exit 77; }
need() { command -v "$1" >/dev/null 2>&1 || skip "${2:-$1} is not installed"; }
made() { echo "$1" >>"$note/files"; }
installed() { echo "$1" >"$note/how"; }
hash_is() {
    [ ${#1} = 32 ] || { echo "no hash, but '$1'"; exit 1; }
    echo "$1" >>"$note/hashes"
}
# A reproducible archive of a folder.
pack() {
    tar --sort=name --owner=0 --group=0 --numeric-owner --mtime="@$commit_time" -C "$(dirname "$1")" -cf - "$(basename "$1")" | gzip -9n >"$2"
    made "$2"
}
# Hash of the enhanced force that a command makes of the scenario: hash_of_command FOLDER STYLET...
hash_of_command() {
    local folder=$1
    shift
    (cd "$folder" && "$@" run "$root/scenarios/three_layers.ron" --out run && "$@" enhance run/recording.csv --out enhanced) >&2
    python3 "$root/packaging/enhanced_hash.py" "$folder/enhanced/enhanced.csv"
}
# Python with the tools of this script.
python="$target/packaging-python/bin/python"
if ! cmp -s packaging/requirements.txt "$target/packaging-python/requirements.stamp"; then
    python3 -m venv "$target/packaging-python"
    "$python" -m pip install --quiet --disable-pip-version-check -r packaging/requirements.txt
    cp packaging/requirements.txt "$target/packaging-python/requirements.stamp"
fi

echo "release build of stylet $version"
cargo build --release --locked -p stylet --features "$features"
mkdir "$temporary/reference"
reference=$(hash_of_command "$temporary/reference" "$target/release/stylet" 2>"$out/logs/reference.log")
recording="$temporary/reference/run/recording.csv"

failed=0
{
    echo "stylet $version, $(uname -sm), $(git rev-parse --short HEAD). Hash: the first 32 digits of the SHA-256 of the enhanced force (64-bit"
    echo "floats) of the recording that \`stylet run scenarios/three_layers.ron\` makes. Built, not installed: $reference"
    echo
    echo "| artefact | size, kB | made in, s | how installed | installed and run in, s | hash |"
    echo "|---|---|---|---|---|---|"
} >"$out/table.md"
for name in "${wanted[@]}"; do
    note="$temporary/$name.note" clean="$temporary/$name"
    mkdir -p "$note" "$clean"
    : >"$note/files" && : >"$note/hashes" && : >"$note/how"
    began=$(date +%s)
    # As statements of their own: a condition would switch `set -e` off inside.
    set +e
    (set -euo pipefail; . "packaging/artefacts/$name.sh"; make) >"$out/logs/$name.log" 2>&1
    code=$?
    between=$(date +%s)
    if [ $code = 0 ]; then
        (set -euo pipefail; . "packaging/artefacts/$name.sh"; check) >>"$out/logs/$name.log" 2>&1
        code=$?
    fi
    set -e
    ended=$(date +%s)
    size=$(xargs -r -d '\n' cat <"$note/files" | wc -c | awk '{ printf "%.0f", $1 / 1000 }')
    others=$(sort -u "$note/hashes" | grep -vx "$reference" | paste -sd' ' || true)
    if [ $code = 77 ]; then
        how="not tested here: $(cat "$note/skipped")" hash="-"
    elif [ $code != 0 ]; then
        failed=1 how="FAILED: see logs/$name.log" hash="-"
    elif [ -n "$others" ] || [ ! -s "$note/hashes" ]; then
        failed=1 how=$(cat "$note/how") hash="DIFFERS: ${others:-none}"
    else
        how=$(cat "$note/how") hash=$reference
    fi
    echo "| $name | $size | $((between - began)) | $how | $((ended - between)) | $hash |" | tee -a "$out/table.md"
    rm -rf "$clean"
done
echo "table: $out/table.md"
exit $failed
