"""What tune.py and run_all.py share: the calls of Stylet, two at a time."""

import concurrent.futures
import json
import pathlib
import shutil
import subprocess

HERE = pathlib.Path(__file__).resolve().parent


def load(name):
    return json.loads((HERE / name).read_text())


def options_of(values):
    return [text for name, value in values.items() for text in (f"--{name}", str(value))]


def in_pairs(work, jobs):
    """Results in the order of the jobs."""
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        return list(pool.map(work, jobs))


class Bench:
    """One exported set of streams and the answers to it."""

    def __init__(self, stylet, env, out):
        self.stylet = shutil.which(stylet) or str(pathlib.Path(stylet).resolve())
        self.out = out.resolve()
        self.streams = self.out / "set"
        env = env.resolve()
        self.places = {"PYTHON": str(env / "bin/python"), "RUST": str(env / "rust/release/stylet-online-peers")}

    def call(self, *arguments):
        run = subprocess.run([self.stylet, "benchmark", *map(str, arguments)], capture_output=True, text=True)
        if run.returncode != 0:
            raise SystemExit(f"stylet benchmark {' '.join(map(str, arguments))} failed:\n{run.stderr}")
        return run.stdout

    def export(self, split, cases, seed):
        if self.streams.exists():
            shutil.rmtree(self.streams)
        self.out.mkdir(parents=True, exist_ok=True)
        self.call("export", "--online", "--split", split, "--cases", cases, "--seed", seed, "--out", self.streams)

    def folder(self, label):
        return self.out / "answers" / label

    def answers(self, label, entrant, values):
        """Has an entrant of settings.json answer the set."""
        command = [self.places.get(word, str(HERE / word) if word.endswith(".py") else word) for word in entrant["command"]]
        command += options_of(values)
        folder = self.folder(label)
        if folder.exists():
            shutil.rmtree(folder)
        folder.parent.mkdir(parents=True, exist_ok=True)
        if entrant.get("offline"):
            at = 2  # PYTHON program DIR OUT --options
            run = subprocess.run([*command[:at], self.streams, folder, *command[at:]], capture_output=True, text=True)
            if run.returncode != 0:
                raise SystemExit(f"{label} failed:\n{run.stderr}")
        else:
            self.call("replay", self.streams, "--out", folder, "--", *command)

    def own_answers(self, algorithm):
        folder = self.folder(algorithm)
        if folder.exists():
            shutil.rmtree(folder)
        folder.parent.mkdir(parents=True, exist_ok=True)
        self.call("replay", self.streams, "--out", folder, "--algorithm", algorithm)

    def score(self, label):
        """The judge's figures over all streams."""
        file = self.out / f"{label}.json"
        self.call("judge-online", self.streams, self.folder(label), "--json", file)
        return json.loads(file.read_text())[0]["all"]
