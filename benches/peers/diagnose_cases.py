"""The cases of a challenge as `regression_tables` wrote them, the problem a regression is given, its answer, and what an answer is worth
while a peer is tuned (as the benchmark scores: `crates/examine/src/judge/answers.rs`)."""

import json

import numpy as np

SAME = 0.98
LARGEST_CLASS = 4


class Case:
    """One case; with `truth`, what a right answer says."""

    def __init__(self, path, truth=None):
        self.number, self.path = path.name.split(".")[0], path
        self.about = json.loads(path.read_text())
        self.truth = truth

    def problem(self, whitened, ruptures):
        names, rows = self.about["columns"], self.about["rows"]
        table = np.fromfile(self.path.with_suffix(".white.f32" if whitened else ".plain.f32"), "<f4")
        table = table.reshape(len(names) + 1, rows).T.astype(float)
        recording, count = np.array(self.about["recording"]), self.about["recordings"]
        keep = np.ones(rows, bool) if ruptures else recording < count
        return Problem(table[keep], names, recording[keep] % count)


class Problem:
    """Residual `y` and columns `x` minus what the parameters of the base law can imitate, in noise standard deviations; columns of
    unit RMS with the effect that each belongs to in `names`, `groups` the recording of every row."""

    def __init__(self, table, names, groups):
        order = np.argsort(groups, kind="stable")
        table, groups = table[order], groups[order]
        base = table[:, 1:][:, [n == "" for n in names]]
        base = base[:, np.any(base != 0.0, axis=0)]
        q, _ = np.linalg.qr(base / np.linalg.norm(base, axis=0))
        own = np.sqrt(np.mean(table**2, axis=0))
        for _ in range(2):
            table = table - q @ (q.T @ table)
        left = np.sqrt(np.mean(table**2, axis=0))
        keep = [k + 1 for k, n in enumerate(names) if n and left[k + 1] > max(1e-3 * own[k + 1], 1e-9)]
        self.y, self.x = table[:, 0].copy(), table[:, keep] / left[keep]
        self.names, self.groups = [names[k - 1] for k in keep], groups
        self.gram = self.x.T @ self.x / len(self.y)

    def contributions(self, coefficients):
        """Per effect the RMS of what it contributes, and its columns."""
        out = {}
        for name in {self.names[k] for k in np.flatnonzero(coefficients)}:
            index = np.array([k for k, n in enumerate(self.names) if n == name])
            c = coefficients[index]
            size = float(np.sqrt(max(c @ self.gram[np.ix_(index, index)] @ c, 0.0)))
            out[name] = (size, [int(k) for k in index[c != 0.0]])
        return out

    def like(self, effect, columns):
        """Other effects with a column that is nearly one of these, most similar first; no more than a class may have."""
        similarity = {}
        for k, name in enumerate(self.names):
            if name != effect:
                similarity[name] = max(similarity.get(name, 0.0), *(abs(self.gram[k, j]) for j in columns))
        order = sorted((n for n in similarity if similarity[n] > SAME), key=lambda n: (-similarity[n], n))
        return order[: LARGEST_CLASS - 1]


def chosen(contributions, least, share, most):
    """Effects that count, largest first: (name, columns)."""
    order = sorted(contributions.items(), key=lambda c: (-c[1][0], c[0]))
    limit = max(least, share * order[0][1][0]) if order else 0.0
    return [(name, columns) for name, (size, columns) in order[:most] if size > 0.0 and size >= limit]


def answer(problem, named):
    """A regression's answer to the challenge."""
    causes = [{"effect": name, "equivalent": problem.like(name, columns)} for name, columns in named]
    if not causes:
        return {"verdict": "none", "causes": []}
    return {"verdict": "ambiguous" if any(c["equivalent"] for c in causes) else "named", "causes": causes}


def right(truth, said):
    """Whether an answer that is not `unknown` is right."""
    classes = [[c["effect"], *c["equivalent"]] for c in said["causes"]]
    taken, missing = set(), False

    def fits(wanted, members):
        names = {wanted["effect"], *wanted["also"]}
        return not wanted["unseen"] and len(members) <= LARGEST_CLASS and bool(names & set(members))

    for wanted in sorted(truth["wanted"], key=lambda w: all(c[0] != w["effect"] for c in classes)):
        free = [k for k, c in enumerate(classes) if k not in taken and fits(wanted, c)]
        exact = [k for k in free if classes[k][0] == wanted["effect"]]
        if free:
            taken.add((exact or free)[0])
        else:
            missing |= not wanted["may_be_silent"]
    described = set(truth["optional"]) | set(truth["allowed"])
    stray = any(k not in taken and not described & set(c) for k, c in enumerate(classes))
    if truth["outside"]:
        return bool(truth["wanted"]) and not missing
    says_allowed = any(set(truth["allowed"]) & set(c) for c in classes)
    return not missing and not stray and (says_allowed or not truth["asks_for_allowed"])
