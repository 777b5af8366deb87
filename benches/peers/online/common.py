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

    def export(self, split, cases, seed, world="plain", measured=None):
        """Writes the streams; the key to them goes to a file beside their folder."""
        if self.streams.exists():
            shutil.rmtree(self.streams)
        self.streams.with_name("set.key.json").unlink(missing_ok=True)
        self.out.mkdir(parents=True, exist_ok=True)
        recordings = ["--measured", measured] if measured else []
        self.call("export", "--online", "--world", world, "--split", split, "--cases", cases, "--seed", seed, *recordings, "--out", self.streams)

    def folder(self, label):
        return self.out / "answers" / label

    def empty_folder(self, label):
        folder = self.folder(label)
        if folder.exists():
            shutil.rmtree(folder)
        folder.parent.mkdir(parents=True, exist_ok=True)
        return folder

    def answers(self, label, entrant, values):
        """Has an entrant of settings.json answer the streams."""
        command = [self.places.get(word, str(HERE / word) if word.endswith(".py") else word) for word in entrant["command"]]
        folder = self.empty_folder(label)
        if entrant.get("offline"):
            run = subprocess.run([*command, self.streams, folder, *options_of(values)], capture_output=True, text=True)
            if run.returncode != 0:
                raise SystemExit(f"{label} failed:\n{run.stderr}")
        else:
            self.call("replay", self.streams, "--out", folder, "--threads", 1, "--", *command, *options_of(values))

    def own_answers(self, algorithm):
        """Has an algorithm of Stylet's own answer the streams."""
        self.call("replay", self.streams, "--out", self.empty_folder(algorithm), "--threads", 1, "--algorithm", algorithm)

    def at_threshold(self, label, threshold):
        """Writes the answers again without the events below this confidence; returns the new label."""
        above = f"{label}_above{threshold:.6g}"
        folder = self.empty_folder(above)
        folder.mkdir()
        with open(self.folder(label) / "events.csv") as lines, open(folder / "events.csv", "w") as kept:
            kept.write(next(lines))
            kept.writelines(line for line in lines if float(line.rsplit(",", 1)[1]) >= threshold)
        return above

    def scores(self, labels):
        """What the judge says of each of these answers over all streams."""
        file = self.out / f"{labels[0]}.json"
        folders = [self.folder(label) for label in labels]
        self.call("judge-online", self.streams, *folders, "--json", file, "--out", self.out / "judged" / labels[0])
        return {score["entrant"]: score for score in json.loads(file.read_text())}
