#!/usr/bin/env python3
"""Checks of the documentation: python3 .ci/docs_check.py STYLET. Standard library only.

1. The book builds without warnings, where mdbook is installed.
2. Every page is in SUMMARY.md; every relative link and anchor leads somewhere; every `docs/...` path in the sources exists.
3. docs/reference/commands.md is what --help says; every command and flag in README and book exists; every command is named in the README or the book; the
   files that --help says a command writes are those in the table of docs/reference/files.md; every message in docs/reference/errors.md is in the sources.
4. Every ```sh block of the tutorials runs, in order, in a temporary folder per page, and prints the ```text block behind it. Its commands write the files of
   the table, and no others.
5. No misspelt word, where typos is installed.
6. The book has at most 45 pages and 25 000 words: words of prose, lists and tables, without code blocks (fenced or indented), HTML and comments.

In a page, `<!-- file: NAME -->` in front of a code block saves it under that name; `<!-- file: NAME of PATH -->` also checks that it is this file; `<!-- not run: reason -->` in front of an ```sh block skips it, `<!-- exit code 2 -->` expects
that exit code.
In an expected output a line `...` stands for any lines, and `...` inside a line for any text. Python blocks of the tutorials run where `import stylet` works in $PYTHON (python3).
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.parse
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.dont_write_bytecode = True
import commands_page  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
faults = []


def fault(text):
    faults.append(text)
    print(f"docs: FAULT: {text}")


def pages():
    return sorted(p for p in DOCS.rglob("*.md"))


def all_markdown():
    tracked = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "*.md"], cwd=ROOT, capture_output=True, text=True)
    return sorted({ROOT / p for p in tracked.stdout.split() if (ROOT / p).is_file()} | set(pages()))


def without_code(text):
    return re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)


def blocks(text):
    """(marker, language, code) of the fenced blocks in order; the marker is the comment on the line in front."""
    pattern = r"(?:<!-- ([^\n]*?) -->\n+)?^```(\w*)[^\n]*\n(.*?)^```"
    return [(m or "", lang, code) for m, lang, code in re.findall(pattern, text, re.S | re.M)]


# 1

def build_book():
    mdbook = shutil.which("mdbook")
    if not mdbook:
        print("docs: mdbook is not installed: the book is not built")
        return
    with tempfile.TemporaryDirectory() as out:
        done = subprocess.run([mdbook, "build", str(DOCS), "--dest-dir", out], capture_output=True, text=True)
        log = done.stdout + done.stderr
        if done.returncode or "WARN" in log or "ERROR" in log:
            fault(f"mdbook: {log}")
        print(f"docs: book built, {len(list(Path(out).rglob('*.html')))} HTML files")


# 2

def slug(heading):
    heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "")
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


def anchors(path):
    found, seen = set(), {}
    for heading in re.findall(r"^#+ (.*)$", without_code(path.read_text()), re.M):
        s = slug(heading)
        found.add(f"{s}-{seen[s]}" if s in seen else s)
        seen[s] = seen.get(s, 0) + 1
    return found


def check_links():
    summary = (DOCS / "SUMMARY.md").read_text()
    in_summary = {(DOCS / p).resolve() for p in re.findall(r"\]\(([^)]+\.md)\)", summary)}
    for page in pages():
        if page.name != "SUMMARY.md" and page.resolve() not in in_summary:
            fault(f"{page.relative_to(ROOT)} is not in SUMMARY.md")
    count = 0
    for page in all_markdown():
        text = re.sub(r"`[^`\n]*`", "``", without_code(page.read_text()))
        for target in re.findall(r"\]\(([^)\s]+)\)", text):
            if re.match(r"[a-z]+:", target):
                continue
            count += 1
            path, _, anchor = urllib.parse.unquote(target).partition("#")
            file = (page.parent / path).resolve() if path else page
            if not file.exists():
                fault(f"{page.relative_to(ROOT)}: no file {target}")
            elif page.is_relative_to(DOCS) and not file.is_relative_to(DOCS):
                fault(f"{page.relative_to(ROOT)}: {target} is outside the book, where the built pages have no link")
            elif anchor and file.suffix == ".md" and anchor not in anchors(file):
                fault(f"{page.relative_to(ROOT)}: no heading {target}")
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True).stdout.split("\n")
    for name in listed:
        path = ROOT / name
        if path.suffix in {".rs", ".ron", ".py", ".sh", ".toml", ".md", ".html", ".js", ".c", ".h", ".cpp", ".pyi"} and path.is_file() and not name.startswith("CHANGELOG"):
            for target in re.findall(r"\bdocs/[\w/-]+\.(?:md|svg|png)", path.read_text(errors="ignore")):
                if not (ROOT / target).exists():
                    fault(f"{name}: there is no {target}")
    print(f"docs: {count} links, {len(pages()) - 1} pages")


# 3

def check_commands(binary):
    page = commands_page.page(binary)
    if not commands_page.PAGE.exists() or commands_page.PAGE.read_text() != page:
        fault("docs/reference/commands.md is stale: python3 .ci/commands_page.py STYLET")
    usage = commands_page.commands(binary)
    flags = {name: set(re.findall(r"(?<![\w-])--[a-z][\w-]*", text)) for name, text in usage.items()}
    every = set().union(*flags.values()) | {"--help", "--version"}
    written = {p: p.read_text() for p in [ROOT / "README.md", *pages()] if p != commands_page.PAGE}
    for name in usage:
        if " " not in name and not any(re.search(rf"\bstylet {name}\b", t) for t in written.values()):
            fault(f"`stylet {name}` is named neither in the README nor in the book")
    for path, text in written.items():
        spans = [line for _, lang, code in blocks(text) if lang in ("sh", "text", "") for line in code.splitlines()]
        spans += re.findall(r"`([^`\n]+)`", without_code(text))
        for span in spans:
            if re.fullmatch(r"--[a-z][\w-]*( .*)?", span):
                for flag in re.findall(r"--[a-z][\w-]*", span):
                    if flag not in every:
                        fault(f"{path.relative_to(ROOT)}: no command has {flag}")
            for call in re.findall(r"(?:^|[\s|;(])stylet ([a-z][^|;#)]*)", span):
                words = call.split()
                name = " ".join(words[:2]) if " ".join(words[:2]) in usage else words[0]
                if name not in usage:
                    if span.startswith("stylet "):
                        fault(f"{path.relative_to(ROOT)}: there is no command {name!r} in {span!r}")
                    continue
                for flag in (w.split("=")[0] for w in words if re.match(r"--[a-z]", w)):
                    if flag not in flags[name] | {"--help"}:
                        fault(f"{path.relative_to(ROOT)}: stylet {name} has no {flag}")
    print(f"docs: {len(usage)} commands, {sum(map(len, flags.values()))} flags")


def check_messages():
    """The messages in the table of errors stand in the sources."""
    sources = "".join(p.read_text() for folder in ("crates", "src") for p in sorted((ROOT / folder).rglob("*.rs")) if "tests" not in p.parts)
    sources = re.sub(r"\\\n\s*", "", sources)
    table = (DOCS / "reference/errors.md").read_text().split("| message contains |")[1]
    for row in re.findall(r"^\| (`.*?) \|", table, re.M):
        for message in re.findall(r"`([^`]+)`", row):
            if message not in sources:
                fault(f"docs/reference/errors.md: no source has the message {message!r}")


def documented_outputs():
    """From docs/reference/files.md: (commands, files that each of them writes, files that it writes in some cases)."""
    rows = re.findall(r"^\| (`[a-z][^|]*) \| (.*) \|(.*)\|$", (DOCS / "reference/files.md").read_text().split("| command | files besides")[1].split("\n\n")[0], re.M)

    def names(cell):
        return {f for f in re.findall(r"`([^`]+)`", cell) if re.search(r"\.\w+$", f)}
    return [(re.findall(r"`([^`]+)`", commands), names(always), names(sometimes)) for commands, always, sometimes in rows]


def check_outputs_in_help(binary):
    table = {command: always | sometimes | {"report.html"} for commands, always, sometimes in documented_outputs() for command in commands}
    for name, text in commands_page.commands(binary).items():
        for sentence in re.findall(r"^Writes (.*?)(?:\.\s|\.?\Z)", text, re.M | re.S):
            for file in re.findall(r"(?<![\w/.])[a-zA-Z][\w-]*\.(?:json|jsonl|csv|ron|svg|html|txt|md)\b", sentence):
                if file[0].islower() and not any(Path(f).name == file for f in table.get(name, ())):
                    fault(f"`stylet {name} --help` says that it writes {file}, docs/reference/files.md does not")


# 4

def check_outputs(page, work, code):
    """The folders that the commands of a page wrote have the documented files."""
    table = documented_outputs()
    folders = [{str(f.relative_to(folder)) for f in folder.rglob("*")} for folder in [work, *(d for d in work.rglob("*") if d.is_dir() and not d.is_symlink())]]
    for manifest in work.rglob("manifest.json"):
        files = set(json.loads(manifest.read_text())["sha256"]) - {"report.html"}
        if not any(always <= files <= always | sometimes for _, always, sometimes in table):
            fault(f"{page}: docs/reference/files.md has no command that writes {sorted(files)}")
    for commands, always, _ in table:
        for command in commands:
            written = {f for f in always if "NNNN" not in f}
            if re.search(rf"\bstylet {command} (?!.*--online)", code) and not any(written <= files for files in folders):
                fault(f"{page}: `stylet {command}` does not write all of {sorted(written)}")


def matches(wanted, printed):
    """Whether the expected lines stand in the output in order."""
    lines = [" ".join(x.split()) for x in printed.splitlines()]
    at, free = 0, True
    for want in (" ".join(x.split()) for x in wanted.strip().splitlines()):
        if want == "...":
            free = True
            continue
        if not want:
            continue
        pattern = re.compile(".*".join(map(re.escape, want.split("..."))))
        while at < len(lines) and not pattern.fullmatch(lines[at]):
            at += 1
        if at == len(lines):
            return want
        at += 1
    return None


def run_tutorials(binary):
    python = os.environ.get("PYTHON", "python3")
    if not shutil.which(python):
        python = "python3"
    has_module = subprocess.run([python, "-c", "import stylet"], capture_output=True).returncode == 0
    ran = 0
    for page in sorted((DOCS / "tutorials").glob("*.md")):
        start = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            work = Path(folder)
            (work / "bin").mkdir()
            (work / "bin/stylet").symlink_to(binary)
            for name in ("scenarios", "crates"):
                (work / name).symlink_to(ROOT / name)
            env = {**os.environ, "PATH": f"{work}/bin:{os.environ['PATH']}", "NO_COLOR": "1", "COLUMNS": "120"}
            printed, python_code, shell_code = None, "", ""
            for marker, lang, code in blocks(page.read_text()):
                if marker.startswith("file: "):
                    (work / marker[6:].split()[0]).write_text(code)
                    if " of " in marker and code != (ROOT / marker.split(" of ")[1]).read_text():
                        fault(f"{page.name}: {marker}: the block is not the file")
                    if lang == "python":
                        continue
                if lang == "text":
                    missing = printed is not None and matches(code, printed)
                    if missing:
                        fault(f"{page.name}: not printed: {missing!r}; printed:\n{printed}")
                    printed = None
                    continue
                printed = None
                if lang not in ("sh", "python"):
                    continue
                if marker.startswith("not run: "):
                    print(f"docs: {page.name}: not run: {code.strip().splitlines()[0]} ({marker[9:]})")
                    continue
                if lang == "python":
                    if not has_module:
                        print(f"docs: {page.name}: a Python block is skipped: {python} has no module stylet")
                        continue
                    # One interpreter's worth of state per page: the blocks so far, then this one.
                    python_code += "print('\\x00')\n" + code
                    command = [python, "-c", python_code]
                else:
                    command = ["bash", "-euo", "pipefail", "-c", code]
                    shell_code += code
                done = subprocess.run(command, cwd=work, env=env, capture_output=True, text=True)
                printed = done.stdout.rsplit("\x00", 1)[-1] + done.stderr
                ran += 1
                wanted = int(marker[10:]) if marker.startswith("exit code ") else 0
                if done.returncode != wanted:
                    fault(f"{page.name}: exit code {done.returncode}: {code}\n{printed}")
            check_outputs(page.name, work, shell_code)
        print(f"docs: {page.name}: {time.monotonic() - start:.1f} s")
    print(f"docs: {ran} blocks ran")
    if ran < 15:
        fault(f"only {ran} blocks found")


# 5

def check_spelling():
    if not shutil.which("typos"):
        print("docs: typos is not installed: spelling is not checked")
        return
    done = subprocess.run(["typos", "--config", str(ROOT / ".ci/typos.toml"), "README.md", "docs"], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        fault(f"typos:\n{done.stdout}{done.stderr}")
    else:
        print("docs: spelling checked")


# 6

def words(text):
    text = re.sub(r"(?<=\n\n)(?: {4}.*\n+)+", "\n", without_code(text))
    text = re.sub(r"<!--.*?-->|</?[a-zA-Z][^>\n]*>", "", text, flags=re.S)
    return sum(any(c.isalnum() for c in word) for word in text.split())


def count_words():
    book = [p for p in pages() if p.name != "SUMMARY.md"]
    total = sum(words(p.read_text()) for p in book)
    print(f"docs: {len(book)} pages, {total} words")
    if len(book) > 45 or total > 25_000:
        fault("the book has more than 45 pages or 25 000 words")
    size = sum(p.stat().st_size for p in DOCS.rglob("*") if p.is_file())
    if size > 4_000_000:
        fault(f"docs/ has {size} bytes, more than 4 MB")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    begin = time.monotonic()
    binary = Path(sys.argv[1]).resolve()
    build_book()
    check_links()
    check_commands(binary)
    check_outputs_in_help(binary)
    check_messages()
    check_spelling()
    run_tutorials(binary)
    count_words()
    print(f"docs: {time.monotonic() - begin:.0f} s, {len(faults)} faults")
    sys.exit(1 if faults else 0)
