#!/usr/bin/env python3
"""Blind naming test: can somebody who knows the field, but not this project, guess what a file is for from its path alone?

usage: tests/blind_naming.py [--seed S] [--count 40] [--root DIR]           prints the list for the reader
       tests/blind_naming.py [--seed S] [--count 40] [--root DIR] --answers  prints the list with the first sentence of each file

Paths are drawn at random from `crates/*/src`; files that a path cannot tell apart from their crate (lib.rs, main.rs, mod.rs at the top,
tests) are left out. The reader writes one sentence per path; a guess is right when it names the same purpose as the file's own first
sentence. The same seed gives the same list.
"""
import argparse, os, random, re

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--count", type=int, default=40)
parser.add_argument("--root", default=os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
parser.add_argument("--answers", action="store_true")
a = parser.parse_args()
a.root = os.path.realpath(a.root)
paths = []
crates = os.path.join(a.root, "crates")
for crate in sorted(os.listdir(crates)):
    for base, folders, files in os.walk(os.path.join(crates, crate, "src")):
        folders.sort()
        for f in sorted(files):
            if f.endswith(".rs") and f not in ("lib.rs", "main.rs", "tests.rs") and "tests" not in os.path.relpath(base, a.root).split(os.sep):
                paths.append(os.path.relpath(os.path.join(base, f), a.root))
paths.sort()
for n, path in enumerate(sorted(random.Random(a.seed).sample(paths, a.count)), 1):
    print(f"{n:2}. {path}")
    if a.answers:
        doc = []
        for line in open(os.path.join(a.root, path), encoding="utf-8"):
            if not line.startswith("//!"):
                break
            doc.append(line[3:].strip())
        text = " ".join(doc)
        print("     ", re.split(r"(?<=[.:]) ", text)[0] if text else "(no description)")
