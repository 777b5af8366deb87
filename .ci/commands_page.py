#!/usr/bin/env python3
"""Writes docs/reference/commands.md from `stylet --help`: python3 .ci/commands_page.py STYLET"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

PAGE = Path(__file__).resolve().parents[1] / "docs/reference/commands.md"

HEAD = """# Commands

Generated from `--help` by `python3 .ci/commands_page.py STYLET`. [Exit codes and common errors](errors.md).

"""

# Options that mean the same for every command that has them; described once.
COMMON = ["--out", "--quiet", "--columns", "--repair", "--limit-memory", "--limit-time"]


def help_of(binary, *words):
    """The help text of a command, 112 columns wide."""
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / "stylet"
        link.symlink_to(Path(binary).resolve())
        env = {**os.environ, "COLUMNS": "112", "NO_COLOR": "1"}
        return subprocess.run([link, *words, "--help"], capture_output=True, text=True, env=env, check=True).stdout


def listed(text):
    """Names of the commands that a help text lists, without `help`."""
    part = re.search(r"^Commands:\n(.*?)(?=^\S|\Z)", text, re.S | re.M)
    return [c for c in re.findall(r"^  ([a-z][\w-]*)", part.group(1) if part else "", re.M) if c != "help"]


def commands(binary):
    """Every command and subcommand with its help text, in order."""
    out = {}
    for name in listed(help_of(binary)):
        out[name] = help_of(binary, name)
        for sub in listed(out[name]):
            out[f"{name} {sub}"] = help_of(binary, name, sub)
    return out


def split_options(text):
    """A help text without the common options, and these by name."""
    kept, common, current = [], {}, None
    for line in text.splitlines():
        option = re.match(r" {2,6}(?:-\w, )?(--[\w-]+)", line)
        if option:
            current = option.group(1) if option.group(1) in [*COMMON, "--help"] else None
            # A file in place of a folder, or no lines at all: of this command alone.
            if "--out <FILE>" in line or "Print no" in line and "nothing but errors" not in line:
                current = None
            if current:
                common[current] = []
        elif line and not line.startswith(" " * 8):
            current = None
        if current:
            common[current].append(line.strip())
        else:
            kept.append(line.rstrip())
    common.pop("--help", None)
    text = re.sub(r"([^\n])\n(Examples?:)", r"\1\n\n\2", "\n".join(kept))
    return re.sub(r"\n{3,}", "\n\n", text), common


def one_line(words):
    """`--flag <VALUE>` and its meaning, from the lines of an option."""
    name, _, meaning = re.sub(r"^-\w, ", "", words[0]).partition("  ")
    return name, " ".join(" ".join([meaning, *words[1:]]).split())


def page(binary):
    every = commands(binary)
    run = {**split_options(every["diagnose"])[1]}
    text = HEAD + "## Common options\n\n| option | meaning |\n|---|---|\n"
    for name in COMMON:
        option, meaning = one_line(run[name])
        text += f"| `{option}` | {meaning.replace('|', chr(92) + '|').replace('<', '&lt;')} |\n"
    text += "\n"
    for name, usage in every.items():
        first, _, rest = usage.partition("\nUsage:")
        rest, common = split_options(f"Usage:{rest}".strip())
        rest = re.sub(r"\nOptions:\n(?=\n|$)", "", rest).strip()
        # Paragraphs behind the examples are prose.
        head, mark, tail = rest.partition("\nExample")
        parts = f"Example{tail}".split("\n\n") if mark else []
        prose = [" ".join(p.split()) for p in parts[1:] if not any(line.startswith(" ") for line in p.splitlines())]
        rest = "\n\n".join([head.rstrip(), *(p for p in parts if " ".join(p.split()) not in prose)])
        summary = " ".join(first.split())
        text += f"{'###' if ' ' in name else '##'} {name}\n\n{summary}{'' if summary.endswith(('?', '.')) else '.'}\n\n```text\n{rest}\n```\n\n"
        text += "".join(p.replace("<", "&lt;") + "\n\n" for p in prose)
        if common:
            text += "[Common options](#common-options): " + ", ".join(f"`{c}`" for c in COMMON if c in common) + ".\n\n"
    return text.rstrip() + "\n"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    PAGE.write_text(page(sys.argv[1]))
