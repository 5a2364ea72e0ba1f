"""A search with two objectives and a choice on which other parameters hang: TPE alone, and with proposals.

python example.py                                   # proposals by rules: no network, no key
python example.py --model openai-chat:gpt-4o        # by a language model (OPENAI_API_KEY)
"""

from __future__ import annotations

import argparse
from pathlib import Path

import optuna
import optunahub


DESCRIPTION = """
A rod is chosen: its material, its length [m], and, if it is a tube, the share of it that is hollow. Minimised are its
mass [kg] and how far it bends under a load at its end [mm].
"""


def objective(trial: optuna.Trial) -> tuple[float, float]:
    """Mass and bending of a rod of 2 cm diameter with 100 N at its end."""
    material = trial.suggest_categorical("material", ["steel", "aluminium", "carbon"])
    length = trial.suggest_float("length", 0.2, 1.0)
    hollow = 0.0
    if trial.suggest_categorical("tube", [True, False]):
        hollow = trial.suggest_float("hollow", 0.1, 0.95)
    density, stiffness = {"steel": (7850, 210e9), "aluminium": (2700, 70e9), "carbon": (1600, 120e9)}[material]
    area, moment = 3.14e-4 * (1 - hollow**2), 7.85e-9 * (1 - hollow**4)
    return density * area * length, 1e3 * 100.0 * length**3 / (3 * stiffness * moment) + 5.0 / length


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", help="vendor and name, like openai-chat:gpt-4o")
    parser.add_argument("--n-trials", type=int, default=60)
    options = parser.parse_args()
    optuna.logging.set_verbosity(optuna.logging.WARNING)

    # From the registry: optunahub.load_module("callbacks/armwright_proposals")
    hub = optunahub.load_local_module(
        "callbacks/armwright_proposals", registry_root=str(Path(__file__).resolve().parents[2])
    )
    proposer = hub.StudyLlmProposer(options.model, DESCRIPTION) if options.model else hub.StudyRulesProposer()
    callback = hub.ProposalCallback(proposer, every=5)
    study = optuna.create_study(directions=["minimize", "minimize"], sampler=optuna.samplers.TPESampler(seed=0))
    study.optimize(objective, n_trials=options.n_trials, callbacks=[callback])

    best = study.best_trials
    print(f"{callback.proposed} proposals by {proposer.name}, faults: {dict(callback.faults) or 'none'}")
    print(
        f"{sum('proposal' in trial.user_attrs for trial in best)} of the {len(best)} trials on the front are proposals"
    )
    for trial in best:
        if "proposal" in trial.user_attrs:
            print(f"  trial {trial.number}: {trial.params}: {trial.user_attrs['reason']}")


if __name__ == "__main__":
    main()
