"""Other methods on the cases of `cargo run --release --example discovery -- cases FOLDER`: the table of docs/discovery.md.

    python3 -m venv venv && venv/bin/pip install -r benches/discovery/requirements.txt
    OPENBLAS_NUM_THREADS=1 venv/bin/python benches/discovery/peers.py FOLDER      # with more threads ARD takes many times as long

Each case is a regression of whitened residuals on the columns of all candidate effects, both without what the model follows.
All methods know the noise of a row (1) where they can use it. An effect is proposed where a method keeps one of its columns; the
first name is the effect whose columns take most away.
"""

import json
import sys
import warnings
from pathlib import Path

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import ARDRegression, LassoLarsIC, lasso_path
from sklearn.model_selection import GroupKFold

warnings.simplefilter("ignore", ConvergenceWarning)


def read(path):
    raw = path.read_bytes()
    end = raw.index(b"\n")
    head = json.loads(raw[:end])
    data = np.frombuffer(raw[end + 1 :], dtype="<f4").astype(float).reshape(-1, head["rows"]).T
    # a gap is measured less model: an effect of size s leaves -s times its column
    return head, -data[:, 0], data[:, 1:] / np.linalg.norm(data[:, 1:], axis=0)


def proposed(effects, x, coefficients):
    """Effects with a column that is kept, the one that moves the residual most first."""
    size = {}
    for name in dict.fromkeys(e for e, c in zip(effects, coefficients) if abs(c) > 1e-9):
        own = [k for k, e in enumerate(effects) if e == name]
        size[name] = np.linalg.norm(x[:, own] @ coefficients[own])
    return sorted(size, key=size.get, reverse=True)


def forward_bic(head, y, x):
    n, names = len(y) - head["base"], list(dict.fromkeys(head["effects"]))
    groups = {e: [k for k, f in enumerate(head["effects"]) if f == e] for e in names}
    chosen, criterion = [], n * np.log(y @ y / n)
    while True:
        best = None
        for name in names:
            if name in chosen:
                continue
            own = x[:, sum((groups[e] for e in [*chosen, name]), [])]
            q, s, _ = np.linalg.svd(own, full_matrices=False)
            q = q[:, s > 1e-6 * s[0]]
            left = y @ y - np.sum((q.T @ y) ** 2)
            value = n * np.log(left / n) + q.shape[1] * np.log(n)
            if best is None or value < best[0]:
                best = (value, name)
        if best is None or best[0] >= criterion:
            return chosen
        criterion = best[0]
        chosen.append(best[1])


def lasso_bic(head, y, x):
    model = LassoLarsIC(criterion="bic", fit_intercept=False, noise_variance=1.0).fit(x, y)
    return proposed(head["effects"], x, model.coef_)


def lasso_one_se(head, y, x):
    visits = np.concatenate([head["visits"], -1 - np.arange(len(y) - len(head["visits"]))])
    alphas = np.max(np.abs(x.T @ y)) / len(y) * np.logspace(0, -3, 40)
    errors = []
    for train, test in GroupKFold(min(8, len(set(visits)))).split(x, y, visits):
        _, path, _ = lasso_path(x[train], y[train], alphas=alphas)
        errors.append(np.mean((y[test, None] - x[test] @ path) ** 2, axis=0))
    mean = np.mean(errors, axis=0)
    error = np.std(errors, axis=0, ddof=1) / np.sqrt(len(errors))
    best = np.argmin(mean)
    largest = np.flatnonzero(mean <= mean[best] + error[best])[0]
    _, path, _ = lasso_path(x, y, alphas=alphas)
    return proposed(head["effects"], x, path[:, largest])


def ard(head, y, x):
    model = ARDRegression(fit_intercept=False, max_iter=100).fit(x, y)
    return proposed(head["effects"], x, np.where(model.lambda_ < model.threshold_lambda, model.coef_, 0.0))


METHODS = {
    "axiscal": None,
    "forward selection, BIC": forward_bic,
    "LASSO, BIC": lasso_bic,
    "LASSO, cross-validation, one standard error": lasso_one_se,
    "ARD": ard,
}


def main():
    cases = [read(p) for p in sorted(Path(sys.argv[1]).glob("*.case"))]
    sets = {name: [c for c in cases if c[0]["cases"] == name] for name in ["planted", "weak", "clean", "scatter"]}
    print("| method | first name right | right name proposed | names proposed | weak: right name proposed | clean: a name | scatter 0.7 µm: a name |")
    print("|---|---|---|---|---|---|---|")
    for label, method in METHODS.items():

        def said(case):
            head, y, x = case
            if method:
                return method(head, y, x)
            # the first group: effects that the touches cannot separate count as one name
            return [e for e in head["axiscal"][0]] if head["axiscal"] else []

        answers = {name: [(c[0]["expects"], said(c)) for c in some] for name, some in sets.items()}
        share = lambda name, what: 100 * np.mean([what(e, s) for e, s in answers[name]])
        first = share("planted", lambda e, s: bool(s) and s[0] in e)
        held = lambda e, s: any(x in e for x in s)
        size = np.mean([len(s) for _, s in answers["planted"]])
        print(
            f"| {label} | {first:.0f} % | {share('planted', held):.0f} % | {size:.1f} | {share('weak', held):.0f} % "
            f"| {share('clean', lambda e, s: bool(s)):.0f} % | {share('scatter', lambda e, s: bool(s)):.0f} % |",
            flush=True,
        )


if __name__ == "__main__":
    main()
