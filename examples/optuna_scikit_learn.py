"""Tunes a scikit-learn classifier with Optuna, alone and with one proposal of a language model in ten trials.

python examples/optuna_scikit_learn.py --model openai-chat:gpt-4o
python examples/optuna_scikit_learn.py --model qwen3 --base-url http://localhost:11434/v1 --n-trials 60

Needs: pip install "armwright[llm]" scikit-learn. Without a model built-in rules propose.
"""

import argparse
from collections.abc import Sequence

import optuna
from sklearn.datasets import load_breast_cancer
from sklearn.ensemble import RandomForestClassifier
from sklearn.model_selection import cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

import armwright as aw
from armwright.llm.configuration import configured_model

DESCRIPTION = """
Which classifier tells malignant from benign tumours best, in scikit-learn's breast cancer data (569 samples, 30 real
features of different scales, two classes)? The value is the mean accuracy of a 3-fold cross-validation. The choices
are a support vector machine on standardised features (svc_*; gamma is SVC's, for the rbf kernel) and a random forest
(forest_*).
"""


def classifier(trial: optuna.Trial):
    """Categorical, whole, log and conditional parameters."""
    if trial.suggest_categorical("classifier", ["svc", "forest"]) == "svc":
        kernel = trial.suggest_categorical("svc_kernel", ["linear", "rbf"])
        c = trial.suggest_float("svc_C", 1e-4, 1e4, log=True)
        gamma = trial.suggest_float("svc_gamma", 1e-6, 1e2, log=True) if kernel == "rbf" else "scale"
        return make_pipeline(StandardScaler(), SVC(C=c, kernel=kernel, gamma=gamma))
    return RandomForestClassifier(
        n_estimators=trial.suggest_int("forest_trees", 10, 100, step=10),
        max_depth=trial.suggest_int("forest_depth", 1, 32, log=True),
        max_features=trial.suggest_categorical("forest_features", ["sqrt", "log2", None]),
        random_state=0,
    )


def search(n_trials: int, seed: int, callback: aw.ProposalCallback | None = None) -> optuna.Study:
    features, classes = load_breast_cancer(return_X_y=True)
    study = optuna.create_study(direction="maximize", sampler=optuna.samplers.TPESampler(seed=seed))
    study.optimize(
        lambda trial: cross_val_score(classifier(trial), features, classes, cv=3).mean(),
        n_trials=n_trials,
        callbacks=[callback] if callback else None,
    )
    return study


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", help="vendor and name, like openai-chat:gpt-4o")
    parser.add_argument("--base-url", help="of an OpenAI-compatible server")
    parser.add_argument("--n-trials", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--origin", default="model", choices=("model", "scripted"), help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    optuna.logging.set_verbosity(optuna.logging.WARNING)

    alone = search(options.n_trials, options.seed)
    print(f"Optuna alone:    accuracy {alone.best_value:.4f} with {alone.best_params}")
    given = aw.ModelOptions(model=options.model, base_url=options.base_url, origin=options.origin)
    model = configured_model(given)
    if model is None:
        print("No language model is configured (--model, ARMWRIGHT_MODEL): built-in rules propose instead.")
        proposer, by = aw.StudyRulesProposer(), "rules"
    else:
        proposer = aw.StudyLlmProposer(model.options, DESCRIPTION)
        by = model.options.model
    callback = aw.ProposalCallback(proposer, every=10, seed=options.seed)
    both = search(options.n_trials, options.seed, callback)
    print(f"With proposals:  accuracy {both.best_value:.4f} with {both.best_params}")
    for trial in both.trials:
        if "proposal" in trial.user_attrs:
            print(f"  trial {trial.number}: accuracy {trial.value:.4f}; {trial.user_attrs['reason']}")
    print(f"{callback.proposed} proposals by {by}, faults: {dict(callback.faults) or 'none'}")


if __name__ == "__main__":
    main()
