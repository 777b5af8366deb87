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

Generated from `--help` by `python3 .ci/commands_page.py STYLET`. The exit codes and the common errors are [here](errors.md).

"""


def help_of(binary, *words):
    """The help text of a command, as the installed binary prints it, 100 columns wide."""
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / "stylet"
        link.symlink_to(Path(binary).resolve())
        env = {**os.environ, "COLUMNS": "100", "NO_COLOR": "1"}
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


def page(binary):
    text = HEAD
    for name, usage in commands(binary).items():
        first, _, rest = usage.partition("\nUsage:")
        rest = "\n".join(line.rstrip() for line in f"Usage:{rest}".strip().splitlines())
        # The same for every command.
        rest = re.sub(r"\n+  -h, --help\n? +Print help[^\n]*", "", rest)
        summary = " ".join(first.split())
        text += f"{'###' if ' ' in name else '##'} {name}\n\n{summary}{'' if summary.endswith(('?', '.')) else '.'}\n\n```text\n{rest}\n```\n\n"
    return text.rstrip() + "\n"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    PAGE.write_text(page(sys.argv[1]))
