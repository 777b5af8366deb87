#!/usr/bin/env python3
"""Size of the diagnosis: code lines, constants and unnamed numbers of `identify` and `diagnose`.

    tests/code_size.py [CRATE ...]

Counted are lines of `src` without tests (modules under `#[cfg(test)]`, files named `tests.rs` and test fixtures), comments and blanks;
constants of numbers; float literals outside constants other than 0, 1/2, 1 and 2; the longest file; and the files outside `tissue` that name a
type of an effect.
"""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
EFFECTS = sorted(
    name
    for file in (ROOT / "crates/tissue/src/effects").glob("*.rs")
    for name in re.findall(r"^pub struct (\w+)", file.read_text(), re.M)
    if "".join(part.capitalize() for part in file.stem.split("_")) == name
)
# A comment, a text or a character: what is no code.
NO_CODE = re.compile(r'//[^\n]*|r#"(?:.|\n)*?"#|"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])\'')
TESTS = re.compile(r"^#\[cfg\(test\)\]\n(?:#\[[^\n]*\]\n)*(?:pub(?:\(crate\))? )?mod \w+ \{\n(?:.|\n)*?^\}\n|^#\[cfg\(test\)\]\n.*;\n", re.M)
FLOAT = re.compile(r"(?<![\w.])(\d[\d_]*\.(?:\d[\d_]*)?(?:e-?\d+)?|\d+e-?\d+)(?![\w.])")
NAMED = re.compile(r"^\s*(?:pub(?:\(\w+\))? )?const \w+: (?:.|\n)*?;", re.M)


def code(file):
    """The code of a source file, and the same with texts, to count lines."""
    text = TESTS.sub("", file.read_text())
    bare = NO_CODE.sub(lambda m: "" if m[0].startswith("//") else '""', text)
    return bare, sum(1 for line in re.sub(r"^\s*//[^\n]*", "", text, flags=re.M).splitlines() if line.strip())


def main():
    crates = sys.argv[1:] or ["identify", "diagnose"]
    total, floats, constants, longest, naming = 0, 0, 0, (0, ""), []
    for crate in crates:
        lines_of_crate = 0
        for file in sorted((ROOT / "crates" / crate / "src").rglob("*.rs")):
            if file.stem in ("tests", "test_fixtures") or "tests" in file.parts[len(ROOT.parts) + 2 :]:
                continue
            bare, lines = code(file)
            lines_of_crate += lines
            constants += len(NAMED.findall(bare))
            numbers = FLOAT.findall(NAMED.sub("", bare))
            floats += sum(1 for n in numbers if float(n.replace("_", "")) not in (0.0, 0.5, 1.0, 2.0))
            longest = max(longest, (len(file.read_text().splitlines()), str(file.relative_to(ROOT))))
            named = [name for name in EFFECTS if re.search(rf"\b{name}\b", bare)]
            if named:
                naming.append(f"{file.relative_to(ROOT / 'crates')} ({', '.join(named)})")
        print(f"{crate}: {lines_of_crate} code lines")
        total += lines_of_crate
    print(f"together: {total} code lines, {constants} constants, {floats} unnamed float literals")
    print(f"longest file: {longest[0]} lines ({longest[1]})")
    print(f"{len(naming)} files name a type of an effect", *naming, sep="\n  ")


main()
