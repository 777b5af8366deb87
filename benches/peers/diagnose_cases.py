"""The cases that `peers_cases` wrote, the problem a regression is given, and when an answer is right."""

import json

import numpy as np

RAW = {"saturation", "quantisation", "force_spikes"}
STRENGTHS = [("strong", 5.0, np.inf), ("medium", 0.5, 5.0), ("faint", 0.15, 0.5)]
SAME = 0.98


class Case:
    """One case: what is known of it, the truth, Stylet's answer."""

    def __init__(self, path):
        self.path = path
        self.about = json.loads(path.read_text())
        self.answer = json.loads(path.with_suffix(".stylet.json").read_text())
        self.hidden = self.about["hidden"]
        self.kind = self.about["kind"]
        self.strength = self.answer["strength"]
        self.raw = bool(RAW & set(self.hidden))
        self.unseen = self.hidden == ["force_gain"]

    def counts(self):
        """Whether it is one of the main rows: seen by somebody, and as a term of the residual."""
        faintest = STRENGTHS[-1][1]
        return not self.raw and not self.unseen and (self.kind != "single" or self.strength >= faintest)

    def problem(self, whitened, ruptures):
        about = self.about
        names = [c["effect"] for c in about["columns"]]
        flat = np.fromfile(self.path.with_suffix(".f32"), "<f4")
        table = flat.reshape(len(names) + 1, about["rows"]).T.astype(float)
        recording, count = np.array(about["recording"]), about["recordings"]
        (a1, a2), sd = about["noise_ar"], about["noise_sd_n"]
        parts = [table[recording == k] for k in range(count)]
        if whitened:
            rho = a1 / (1.0 - a2)
            inner = np.sqrt(max(1.0 - a1 * rho - a2 * (a2 + a1 * rho), 1e-4))
            parts = [(p[2:] - a1 * p[1:-1] - a2 * p[:-2]) / inner for p in parts]
        groups = [np.full(len(p), k) for k, p in enumerate(parts)]
        if ruptures:
            parts.append(table[recording >= count])
            groups.append(recording[recording >= count] - count)
        return Problem(np.vstack(parts) / sd, names, np.concatenate(groups))


class Problem:
    """Residual `y` and columns `x` less what the base parameters imitate, in noise standard deviations; columns of
    unit RMS with the effect that each belongs to in `names`, `groups` the recording of every row."""

    def __init__(self, table, names, groups):
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

    def stands_for(self, effect, columns):
        """Whether one of these columns is nearly one of the effect's."""
        own = [k for k, n in enumerate(self.names) if n == effect]
        return any(abs(self.gram[k, j]) > SAME for k in own for j in columns)


def chosen(contributions, least, share, most):
    """Effects that count, largest first: (name, columns)."""
    order = sorted(contributions.items(), key=lambda c: (-c[1][0], c[0]))
    limit = max(least, share * order[0][1][0]) if order else 0.0
    return [(name, columns) for name, (size, columns) in order[:most] if size > 0.0 and size >= limit]


def judge(case, problem, named):
    """Whether a regression's answer is exactly right, and whether it is right when classes count."""
    names = [name for name, _ in named]
    if case.kind in ("clean", "outside") or case.unseen:
        return not names, not names
    meant = set()
    for name, columns in named:
        near = [h for h in case.hidden if problem.stands_for(h, columns)]
        meant.add(name if name in case.hidden else near[0] if near else None)
    return sorted(names) == sorted(case.hidden), len(names) == len(case.hidden) and meant == set(case.hidden)


def judge_stylet(case):
    """The same for Stylet's answer."""
    verdict, named = case.answer["verdict"], case.answer["named"]
    if case.kind == "clean" or case.unseen:
        return verdict == "none", verdict == "none"
    if case.kind == "outside":
        right = verdict not in ("named", "ambiguous")
        return right, right
    exactly = sorted(n[0] for n in named) == sorted(case.hidden)
    return exactly, len(named) == len(case.hidden) and all(any(h in n for n in named) for h in case.hidden)


def wilson(right, of):
    """95 % interval of a rate."""
    p, z = right / of, 1.96
    middle = (p + z * z / (2 * of)) / (1 + z * z / of)
    half = z / (1 + z * z / of) * np.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    return max(middle - half, 0.0), min(middle + half, 1.0)


def rows(cases):
    """The rows of the table: name, cases, whether the right or the wrong answers are counted."""

    def of(kind):
        return [c for c in cases if c.kind == kind and c.counts()]

    out = [("clean: falsely accused", of("clean"), False)]
    for name, low, high in STRENGTHS:
        members = [c for c in of("single") if low <= c.strength < high]
        out.append((f"one effect, {name}: named, or in its class", members, True))
    out.append(("two effects, both named", of("two"), True))
    out.append(("outside the library: wrongly named", of("outside"), False))
    out.append(("read off the raw force", [c for c in cases if c.raw and c.kind == "single"], True))
    out.append(("force_gain: nothing named", [c for c in cases if c.unseen], True))
    return out
