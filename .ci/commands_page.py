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

Written by `python3 .ci/commands_page.py STYLET` from `--help`. [Exit codes and errors](errors.md).

"""

# Options of many commands, described once where a command describes them as `stylet check` does.
COMMON = ["--data", "--columns", "--repair", "--effects", "--out", "--quiet", "--limit-memory", "--limit-time"]


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


def options(text):
    """The lines of each option of a help text, by name."""
    found, current = {}, None
    for line in text.splitlines():
        option = re.match(r" {2,6}(?:-\w, )?(--[\w-]+)", line)
        if option:
            current = found.setdefault(option.group(1), [])
        elif line and not line.startswith(" " * 8):
            current = None
        if current is not None:
            current.append(line)
    return found


def one_line(lines):
    """`--flag <VALUE>` and its meaning, from the lines of an option."""
    name, _, meaning = re.sub(r"^-\w, ", "", lines[0].strip()).partition("  ")
    return name, " ".join(" ".join([meaning, *lines[1:]]).split())


def split_options(text, common):
    """A help text without the options that are in `common` with the same meaning, and their names."""
    every = options(text)
    left_out = [name for name in common if name in every and one_line(every[name])[1] == common[name][1]]
    for name in [*left_out, "--help"]:
        text = text.replace("\n".join(every.get(name, [])) + "\n", "", 1)
    text = re.sub(r"([^\n])\n(Examples?:)", r"\1\n\n\2", text)
    return re.sub(r"\n{3,}", "\n\n", text), left_out


def page(binary):
    every = commands(binary)
    described = options(every["check"])
    common = {name: one_line(described[name]) for name in COMMON}
    text = HEAD + "## Common options\n\n| option | meaning |\n|---|---|\n"
    for option, meaning in common.values():
        text += f"| `{option}` | {meaning.replace('|', chr(92) + '|').replace('<', '&lt;')} |\n"
    text += "\n"
    for name, usage in every.items():
        first, _, rest = usage.partition("\nUsage:")
        rest, left_out = split_options(f"Usage:{rest}".strip() + "\n", common)
        rest = re.sub(r"\nOptions:\n(?=\n|$)", "", rest).strip()
        # Paragraphs behind the examples are prose.
        head, mark, tail = rest.partition("\nExample")
        parts = f"Example{tail}".split("\n\n") if mark else []
        prose = [" ".join(p.split()) for p in parts[1:] if not any(line.startswith(" ") for line in p.splitlines())]
        rest = "\n\n".join([head.rstrip(), *(p for p in parts if " ".join(p.split()) not in prose)])
        summary = " ".join(first.split())
        text += f"{'###' if ' ' in name else '##'} {name}\n\n{summary}{'' if summary.endswith(('?', '.')) else '.'}\n\n```text\n{rest}\n```\n\n"
        text += "".join(p.replace("<", "&lt;") + "\n\n" for p in prose)
        if left_out:
            text += "Common options: " + ", ".join(f"`{c}`" for c in left_out) + ".\n\n"
    return text.rstrip() + "\n"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    PAGE.write_text(page(sys.argv[1]))
