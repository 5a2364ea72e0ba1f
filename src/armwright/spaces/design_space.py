"""The design space: what the search may vary, and the arm that a design builds.

A matrix of designs has one row per design and one column per parameter. A choice is represented by its index. Inactive
parameters have their default value: the middle of a range, the first of the choices.
"""

from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, Self, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from armwright.arrays import Array
from armwright.exceptions import DesignError, SpaceError, did_you_mean
from armwright.robot.arm import Arm
from armwright.spaces.arm_builder import build_arm
from armwright.spaces.custom_parameters import NUMBERED
from armwright.spaces.design_parameters import check_parameters, named_parameters
from armwright.spaces.joint_modules import MODULES
from armwright.spaces.parameters import CategoricalParameter, Design, FloatParameter, Parameter, ParameterValue
from armwright.spaces.space_schema import SpaceSchema
from armwright.tasks.tool import NO_TOOL, Tool
from armwright.yaml_documents import check_document, parse_document, read_document

TOY_MASS = 0.1  # [kg] of a whole arm
BUILT_IN = resources.files("armwright.spaces") / "builtin"


class DesignSpace(SpaceSchema, frozen=True):
    """A serial arm of joint modules, whose base position, joint types and link lengths are varied, and more.

    The first joint is at the origin O; link j follows joint j along local +z; with all joints at 0 the links form one
    vertical line. In the space of the paper that is all: 2 D + 3 parameters.
    """

    @model_validator(mode="after")
    def _check_parameters(self) -> Self:
        check_parameters(self)
        return self

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters in their fixed order: origin, joint types, link lengths, …; tied ones, too."""
        return tuple(named_parameters(self).values())

    @property
    def max_reach(self) -> float:
        """The length of the longest possible arm without a tool, with all slides extended [m]."""
        known = {parameter.name: parameter for parameter in self.parameters}
        reach = 0.0
        for module in range(1, self.max_joints + 1):
            link, joint, stroke = (known.get(f"{kind}_{module}") for kind in ("link", "joint", "stroke"))
            assert isinstance(link, FloatParameter)
            assert isinstance(joint, CategoricalParameter)
            may_slide = any(MODULES[letter].is_prismatic for letter in joint.choices)  # pyright: ignore[reportArgumentType]
            longest = stroke.high if isinstance(stroke, FloatParameter) else self.min_stroke
            reach += link.high + (longest if may_slide else 0.0)
        return reach

    @property
    def custom_names(self) -> frozenset[str]:
        """The names of the custom parameters, which do not change the arm."""
        custom = dict(self.custom)
        names = (parameter.name for parameter in self.parameters)
        return frozenset(name for name in names if NUMBERED.sub("", name) in custom)

    def with_custom(self, design: Design, like: Design | None = None) -> Design:
        """Return a design with the custom parameters of another one, or with their defaults."""
        source: Mapping[str, ParameterValue] = {} if like is None else like.params
        names = self.custom_names & design.params.keys()
        custom = {p.name: source.get(p.name, p.default) for p in self.parameters if p.name in names}
        return Design({**design.params, **custom})

    def is_free(self, name: str, params: Mapping[str, ParameterValue]) -> bool:
        """Return whether a parameter is active and not tied, given the values of the parameters before it."""
        return name not in dict(self.tie) and named_parameters(self)[name].is_active(params, self.max_joints)

    def condition(self, name: str) -> tuple[int, str] | None:
        """Return the module that a parameter requires and the types it may have; None if it is always active."""
        parameter = named_parameters(self)[name]
        if parameter.module is None:
            return None
        return parameter.module, "".join(self.joint_types if parameter.types is None else sorted(parameter.types))

    def design(self, params: Mapping[str, Any]) -> Design:
        """Return the design with these values, in the order of the space.

        Tied values may be missing. Values of inactive parameters are left out. Raises DesignError if a value is
        unknown, missing or outside its range.
        """
        known = named_parameters(self)
        for name in params:
            if name not in known:
                raise DesignError(
                    f'unknown parameter "{name}". Parameters: {", ".join(known)}.{did_you_mean(name, known)}'
                )
        given = self._with_ties(params)
        checked: dict[str, ParameterValue] = {}
        missing: list[str] = []
        for name, parameter in known.items():
            if not parameter.is_active(checked, self.max_joints):
                continue
            if name in given:
                checked[name] = parameter.check(given[name])
            else:
                missing.append(name)
        if missing:
            raise DesignError(f"missing: {', '.join(missing)}")
        for name, other in self.tie:
            if name in checked and other in checked and checked[name] != checked[other]:
                raise DesignError(f"{name} = {checked[name]} is tied to {other} = {checked[other]}")
        return Design(checked)

    def free_values(self, design: Design) -> dict[str, ParameterValue]:
        """Return the values of a design that are not tied."""
        return {name: value for name, value in design.params.items() if name not in dict(self.tie)}

    def from_free_values(self, params: Mapping[str, ParameterValue]) -> Design:
        """Return the design with these free values."""
        given = self._with_ties(params)
        return Design({name: given[name] for name in named_parameters(self) if name in given})

    def _with_ties(self, params: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values with missing tied ones filled in."""
        return {**{name: params[other] for name, other in self.tie if other in params}, **params}

    def clipped(
        self, origin: Iterable[float], joints: str, links: Iterable[float], like: Design | None = None
    ) -> Design:
        """Return the design with this base position [m], joint letters and link lengths [m], each moved into its range.

        All other values are those of `like`. Those that it lacks have their defaults; actuators are by default the
        strongest at the base and the weakest at the tip.
        """
        known: dict[str, Any] = _default_motors(self)
        known |= {} if like is None else like.params
        known |= {f"origin_{axis}": value for axis, value in zip("xyz", origin, strict=True)}
        known |= {f"joint_{j}": letter for j, letter in enumerate(joints, start=1)}
        known |= {f"link_{j}": length for j, length in enumerate(links, start=1)}
        known["n_joints"] = str(min(max(len(joints), self.min_joints), self.max_joints))
        row = [p.encode(p.nearest(known[p.name]) if p.name in known else p.default) for p in self.parameters]
        return self.designs(np.array([row], dtype=np.float64))[0]

    def matrix(self, designs: Sequence[Design]) -> Array:
        """Return the (N, P) matrix of N designs."""
        parameters = self.parameters
        defaults = [p.default for p in parameters]
        columns = [
            [p.encode(design.params.get(p.name, default)) for design in designs]
            for p, default in zip(parameters, defaults, strict=True)
        ]
        return np.array(columns, dtype=np.float64).T.reshape(len(designs), len(parameters))

    def designs(self, matrix: Array) -> list[Design]:
        """Return the designs of the (N, P) rows of a matrix."""
        parameters = self.parameters
        designs: list[Design] = []
        for row in self.normalised(matrix).tolist():
            params: dict[str, ParameterValue] = {}
            for parameter, number in zip(parameters, row, strict=True):
                if parameter.is_active(params, self.max_joints):
                    params[parameter.name] = parameter.decode(number)
            designs.append(Design(params))
        return designs

    def normalised(self, matrix: Array) -> Array:
        """Return the (N, P) rows as `matrix` would: tied values equal, inactive parameters at their defaults."""
        parameters = self.parameters
        if not self.tie and all(parameter.module is None for parameter in parameters):
            return matrix
        rows = matrix.copy()
        column = {parameter.name: i for i, parameter in enumerate(parameters)}
        for name, other in self.tie:
            rows[:, column[name]] = rows[:, column[other]]
        for i, parameter in enumerate(parameters):
            if parameter.module is not None:
                rows[~self.active(parameter.name, rows), i] = parameter.encode(parameter.default)
        return rows

    def active(self, name: str, matrix: Array) -> NDArray[np.bool_]:
        """Return the (N,) designs of a matrix for which a parameter is active."""
        known, active = named_parameters(self), np.ones(len(matrix), dtype=bool)
        parameter, column = known[name], list(known).index
        if parameter.module is not None and "n_joints" in known:
            active &= parameter.module <= matrix[:, column("n_joints")] + self.min_joints
        if parameter.module is not None and parameter.types is not None:
            joint = f"joint_{parameter.module}"
            letters = cast("CategoricalParameter", known[joint]).choices
            active &= np.isin(letters, list(parameter.types))[matrix[:, column(joint)].astype(np.intp)]
        return active

    def sample(self, n: int, seed: int) -> list[Design]:
        """Return `n` designs, uniform in every parameter."""
        return self.designs(self.sample_matrix(n, np.random.default_rng(seed)))

    def sample_matrix(self, n: int, rng: np.random.Generator) -> Array:
        """Return the (n, P) matrix of designs that are uniform in every parameter."""
        parameters = self.parameters
        rows = [[parameter.sample(rng) for parameter in parameters] for _ in range(n)]
        return self.normalised(np.array(rows, dtype=np.float64).reshape(n, len(parameters)))

    def arm(self, design: Design, tool: Tool = NO_TOOL) -> Arm:
        """Return the arm that a design builds, with a tool at its end; DesignError if not in the space."""
        if not self.min_joints <= len(design.joints) == len(design.links) <= self.max_joints:
            self.design(design.params)  # raises the reason
        return build_arm(self, self.matrix([design]), tool)

    @property
    def is_toy(self) -> bool:
        """True if even the heaviest arm is nearly massless, as in the paper."""
        heaviest = max((record.mass for record in self.actuators), default=0.0)
        return self.max_joints * (self.heaviest_link + heaviest + max(self.bracket_masses)) < TOY_MASS

    @property
    def mass_note(self) -> str:
        """One sentence on the assumed masses; it accompanies all torques."""
        toy = "; a toy: real arms weigh kilograms, so read its N m as a comparison only" if self.is_toy else ""
        names = ", ".join(record.name for record in self.actuators)
        supply = "the highest voltage that those of an arm share" if self.supply is None else f"{self.supply:g} V"
        actuators = f"; actuators: {names}, at {supply}" if self.actuators else ""
        low, high = min(self.bracket_masses), max(self.bracket_masses)
        brackets = f"; brackets: {low:.3g}{f' to {high:.3g}' if high > low else ''} kg for each joint that moves"
        brackets = f"{brackets}{', assumed' if self.bracket_mass is None else ''}" if high > 0.0 else ""
        column = f"; the base on a column of {self.column.description}" if self.column else ""
        return f"links: {self.link_description}{toy}{actuators}{brackets}{column}"


def _default_motors(space: SpaceSchema) -> dict[str, str]:
    """Return an actuator for each module, if there is a choice: from the strongest at the base to the weakest."""
    if len(space.actuators) < 2:
        return {}
    ranked = sorted(space.arm_actuators, key=lambda actuator: -actuator.peak_torque)
    return {f"motor_{j + 1}": ranked[len(ranked) * j // space.max_joints].name for j in range(space.max_joints)}


def paper_space(joints: int = 4) -> DesignSpace:
    """Return the design space of the paper, whose experiments have arms of 4 joints.

    Examples:
        >>> import armwright as aw
        >>> space = aw.paper_space(joints=2)
        >>> [parameter.name for parameter in space.parameters]
        ['origin_x', 'origin_y', 'origin_z', 'joint_1', 'joint_2', 'link_1', 'link_2']
        >>> params = {"origin_x": 0, "origin_y": 0, "origin_z": 0.1, "joint_1": "Y", "joint_2": "P", "link_1": 0.2}
        >>> space.design(params | {"link_2": 0.3}).joints
        'YP'
        >>> space.design(params | {"link_2": 0.4})
        Traceback (most recent call last):
        armwright.exceptions.DesignError: link_2 = 0.4 m is outside 0.03 <= link_2 <= 0.3 m
    """
    content = {"name": "paper" if joints == 4 else f"paper-{joints}", "joints": joints}
    return check_document(content, DesignSpace, SpaceError, "paper_space")


def builtin_spaces() -> list[str]:
    """Return the names of the spaces that come with armwright, the paper's first."""
    return ["paper", *sorted(f.name.removesuffix(".yaml") for f in BUILT_IN.iterdir() if f.name.endswith(".yaml"))]


def default_space(task: str) -> DesignSpace:
    """Return the design space for a task without a stated one: the built-in space of the task's name, or the paper's.

    Examples:
        >>> from armwright.spaces.design_space import default_space
        >>> default_space("desk-sorting").name, default_space("target-1").name
        ('desk-sorting', 'paper')
    """
    return load_space(task) if task in builtin_spaces() else paper_space()


def load_space(name_or_path: str | Path) -> DesignSpace:
    """Load a built-in space by name, or a YAML file. Keys that a file leaves out are as in the paper.

    Examples:
        >>> import armwright as aw
        >>> aw.load_space("slideopt").joint_types
        ('R', 'P', 'Y', 'O', 'S', 'F')
    """
    name = str(name_or_path)
    if name == "paper":
        return paper_space()
    if name in builtin_spaces():
        file = BUILT_IN / f"{name}.yaml"
        return parse_document(file.read_text(encoding="utf-8"), DesignSpace, SpaceError, file.name)
    path = Path(name_or_path)
    if not path.exists() and path.suffix not in (".yaml", ".yml"):
        known = builtin_spaces()
        raise SpaceError(
            f'unknown space "{name}".{did_you_mean(name, known)} Built-in spaces: {", ".join(known)}; or give a YAML '
            "file"
        )
    return read_document(path, DesignSpace, SpaceError)
