"""Solves ZDT1 (two objectives, 30 parameters) with NSGA-II, alone and with one proposal of a language model in ten.

python examples/optuna_zdt1.py --model openai-chat:gpt-4o
python examples/optuna_zdt1.py --model qwen3 --base-url http://localhost:11434/v1 --n-trials 1000

Needs: pip install "armwright[llm]". Without a model built-in rules propose.
"""

import argparse
import math
from collections.abc import Sequence

import numpy as np
import optuna

import armwright as aw
from armwright.llm.configuration import configured_model

N = 30  # parameters
REFERENCE_POINT = (1.1, 11.0)  # nothing is worse

DESCRIPTION = f"""
Two functions of x01 … x{N}, each from 0 to 1, are minimised together. The first is x01 alone. The second falls as x01
rises, and grows with all the others, each of which is as good as any other of them.
"""


def zdt1(trial: optuna.Trial) -> tuple[float, float]:
    x = [trial.suggest_float(f"x{i:02d}", 0.0, 1.0) for i in range(1, N + 1)]
    g = 1.0 + 9.0 * sum(x[1:]) / (N - 1)
    return x[0], g * (1.0 - math.sqrt(x[0] / g))


def search(n_trials: int, seed: int, callback: aw.ProposalCallback | None = None) -> optuna.Study:
    sampler = optuna.samplers.NSGAIISampler(population_size=20, seed=seed)
    study = optuna.create_study(directions=["minimize", "minimize"], sampler=sampler)
    study.optimize(zdt1, n_trials=n_trials, callbacks=[callback] if callback else None)
    return study


def result(study: optuna.Study) -> str:
    volume = aw.hypervolume(np.array([trial.values for trial in study.trials]), REFERENCE_POINT)
    return f"hypervolume {volume:.4f}, {len(study.best_trials)} trials on the front"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", help="vendor and name, like openai-chat:gpt-4o")
    parser.add_argument("--base-url", help="of an OpenAI-compatible server")
    parser.add_argument("--n-trials", type=int, default=400)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--origin", default="model", choices=("model", "scripted"), help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    optuna.logging.set_verbosity(optuna.logging.WARNING)

    print(f"Optuna alone:    {result(search(options.n_trials, options.seed))}")
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
    print(f"With proposals:  {result(both)}")
    on_front = sum("proposal" in trial.user_attrs for trial in both.best_trials)
    print(f"{callback.proposed} proposals by {by}, {on_front} of them on the front, ", end="")
    print(f"faults: {dict(callback.faults) or 'none'}")


if __name__ == "__main__":
    main()
