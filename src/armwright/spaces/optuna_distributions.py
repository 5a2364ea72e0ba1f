"""Optuna distributions of a design space."""

from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution, IntDistribution

from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import FloatParameter, Parameter


def distributions(space: DesignSpace) -> dict[str, BaseDistribution]:
    """Return the distribution of each parameter that is not tied."""
    free = [p for p in space.parameters if p.name not in dict(space.tie)]
    return {p.name: _distribution(p) for p in free}


def _distribution(parameter: Parameter) -> BaseDistribution:
    if isinstance(parameter, FloatParameter) and parameter.integer:
        low, high, step = (round(value) for value in (parameter.low, parameter.high, parameter.step))
        return IntDistribution(low, high, log=parameter.log, step=step)
    if isinstance(parameter, FloatParameter):
        return FloatDistribution(parameter.low, parameter.high, log=parameter.log, step=parameter.step or None)
    return CategoricalDistribution(parameter.choices)
