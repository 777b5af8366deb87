"""The peers. Each has two functions: `scan(problem)` gives the coefficients for every setting, `fit(problem, setting)` for one,
by the package's own interface on all rows: that is what is judged and timed.

Where only sums of squares and products count (forward regression, thresholded least squares) `scan` works on a
problem with as many rows as columns that has the same ones; `fit` agrees with it (FROLS: but for how its variance takes the mean).
"""

import numpy as np
import pysindy as ps
from sklearn.linear_model import Lasso, LassoCV
from sklearn.model_selection import LeaveOneGroupOut
from sysidentpy.basis_function import Polynomial
from sysidentpy.model_structure_selection import FROLS
from sysidentpy.model_structure_selection.ofr_base import aic, bic, fpe, lilc
from sysidentpy.parameter_estimation import LeastSquares


class LassoPeer:
    """Folds are whole recordings; the penalty of the smallest error, or the largest within one standard error."""

    @staticmethod
    def path(p):
        folds = list(LeaveOneGroupOut().split(p.x, p.y, p.groups))
        return LassoCV(alphas=60, cv=folds, fit_intercept=False, max_iter=3000).fit(p.x, p.y)

    @staticmethod
    def coefficients(p, path, rule):
        if rule == "min":
            return path.coef_
        mean = path.mse_path_.mean(axis=1)
        best = int(np.argmin(mean))
        error = path.mse_path_[best].std(ddof=1) / np.sqrt(path.mse_path_.shape[1])
        alpha = path.alphas_[np.flatnonzero(mean <= mean[best] + error)[0]]
        return Lasso(alpha=alpha, fit_intercept=False, max_iter=3000).fit(p.x, p.y).coef_

    def scan(self, p):
        path = self.path(p)
        return {(rule,): self.coefficients(p, path, rule) for rule in ("min", "one standard error")}

    def fit(self, p, setting):
        return self.coefficients(p, self.path(p), setting[0])


class FrolsPeer:
    """Candidates as inputs of degree 1, present values only (NFIR) or with one lag of the output (NARX)."""

    MOST_TERMS = 10
    CRITERIA = {"aic": aic, "bic": bic, "fpe": fpe, "lilc": lilc}

    def model(self, kind, criterion, inputs):
        return FROLS(
            order_selection=True,
            n_info_values=self.MOST_TERMS,
            info_criteria=criterion,
            ylag=1,
            xlag=[[1]] * inputs,
            model_type="NFIR" if kind == "NFIR" else "NARMAX",
            estimator=LeastSquares(),
            basis_function=Polynomial(degree=1),
        )

    @staticmethod
    def columns(p, kind, order, theta):
        """Coefficients of our columns: a constant is a bias of the force, an autoregression multiplies what lasts."""
        out, pole, inputs_from = np.zeros(len(p.names)), 0.0, 2 if kind == "NARX" else 1
        for term, value in zip(order, theta):
            if term >= inputs_from:
                out[term - inputs_from] += value
            elif term == 0 and "force_bias" in p.names:
                out[p.names.index("force_bias")] += value
            elif term == 1:
                pole = value
        return out / max(1.0 - pole, 0.01)

    def scan(self, p):
        n = len(p.y)
        before = np.concatenate([[0.0], p.y[:-1]])
        before[1:][p.groups[1:] != p.groups[:-1]] = 0.0
        small = np.linalg.qr(np.column_stack([np.ones(n), before, p.x, p.y]), mode="r")
        y, total = small[:, -1], float(small[:, -1] @ small[:, -1])
        out = {}
        for kind in ("NFIR", "NARX"):
            psi = small[:, :-1] if kind == "NARX" else np.delete(small[:, :-1], 1, axis=1)
            model = self.model(kind, "bic", p.x.shape[1])
            ratio, order, _ = model.run_mss_algorithm(psi, np.concatenate([[0.0], y])[:, None], self.MOST_TERMS + 1)
            left = [max(total * (1.0 - ratio[: k + 1].sum()), 1e-12) / (n - 1) for k in range(self.MOST_TERMS)]
            for name, criterion in self.CRITERIA.items():
                values = np.array([criterion(k + 1, n, s) for k, s in enumerate(left)])
                rising = np.flatnonzero(np.diff(values) > 0)
                terms = order[: int(rising[0]) + 1 if len(rising) else self.MOST_TERMS]
                theta = np.linalg.lstsq(psi[:, terms], y, rcond=None)[0]
                out[(kind, name)] = self.columns(p, kind, terms, theta)
        return out

    def fit(self, p, setting):
        kind, criterion = setting
        model = self.model(kind, criterion, p.x.shape[1])
        # The package's inputs count from one sample ago: they are handed over one sample early.
        model.fit(X=np.vstack([p.x[1:], p.x[-1:]]), y=p.y[:, None])
        return self.columns(p, kind, model.pivv[: model.n_terms], np.ravel(model.theta))


class SindyPeer:
    """Identity library over the candidates, one trajectory per recording, the residual in place of derivatives."""

    THRESHOLDS = [0.03, 0.05, 0.08, 0.12, 0.2, 0.3, 0.5, 0.8]

    def scan(self, p):
        small = np.linalg.qr(np.column_stack([p.x, p.y]), mode="r")
        x, y, n = small[:, :-1], small[:, -1], len(p.y)
        settings = [(t, s) for t in self.THRESHOLDS for s in self.SECOND]
        return {s: np.ravel(self.optimizer(*s, n).fit(x, y).coef_) for s in settings}

    def fit(self, p, setting):
        model = ps.SINDy(optimizer=self.optimizer(*setting, len(p.y)), feature_library=ps.IdentityLibrary())
        which = [p.groups == k for k in np.unique(p.groups)]
        model.fit(x=[p.x[w] for w in which], t=0.01, x_dot=[p.y[w][:, None] for w in which])
        return np.ravel(model.coefficients())


class StlsqPeer(SindyPeer):
    """Second setting: the ridge, per row."""

    SECOND = [1e-6, 1e-3, 1e-2, 1e-1]

    @staticmethod
    def optimizer(threshold, ridge, n):
        return ps.STLSQ(threshold=threshold, alpha=ridge * n)


class Sr3Peer(SindyPeer):
    """Second setting: how far the sparse coefficients may be from the others, per row."""

    SECOND = [0.3, 3.0]

    @staticmethod
    def optimizer(threshold, relaxed, n):
        weight = ps.SR3.calculate_l0_weight(threshold, relaxed / n)
        return ps.SR3(reg_weight_lam=weight, relax_coeff_nu=relaxed / n, max_iter=100, unbias=True)


PEERS = {
    "LassoCV (scikit-learn)": LassoPeer(),
    "FROLS (SysIdentPy)": FrolsPeer(),
    "STLSQ (PySINDy)": StlsqPeer(),
    "SR3 (PySINDy)": Sr3Peer(),
}
