"""The interface of proposers for Optuna studies."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol

import optuna

from armwright.exceptions import ProposalError, SettingsError
from armwright.proposers.for_optuna.parameter_values import describe
from armwright.proposers.for_optuna.parameters import Space, observed_space


@dataclass(frozen=True)
class StudyProposal:
    """Parameters to evaluate next; the study's sampler draws those that are missing."""

    params: Mapping[str, Any]  # values by parameter name
    id: str  # unique within the study
    reason: str = ""  # one line


class StudyProposer(Protocol):
    """Proposes trials for an Optuna study; subclass it and implement `propose`."""

    name: str  # the `source` of its trials
    given_space: Space = MappingProxyType({})  # distributions that take precedence over those of the trials so far

    def space(self, study: optuna.Study) -> Space:
        """Return the distributions of the parameters: the given ones, completed by those of the trials so far.

        Raises:
            SettingsError: A given distribution differs in kind from the study's.
            ProposalError: There are none yet.
        """
        observed = observed_space(study)
        for name, distribution in self.given_space.items():
            if type(observed.get(name, distribution)) is not type(distribution):
                raise SettingsError(
                    f"space says that {name} is {describe(distribution)}; in the study's trials it is "
                    f"{describe(observed[name])}"
                )
        if not observed and not self.given_space:
            reason = f"no trial has shown a parameter yet; give {type(self).__name__}(space=…)"
            raise ProposalError("space", reason)
        return {**observed, **self.given_space}

    def propose(self, study: optuna.Study, seed: int, number: int) -> StudyProposal:
        """Propose the next trial. Several threads may call this at a time.

        Args:
            study: the study so far.
            seed: of all random draws.
            number: approximate number of the next trial, for the id.

        Raises:
            ProposalError: There is no proposal.
        """
        ...
