"""The design space: what the search may vary, and the arm that a design builds."""

from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, Self

from pydantic import model_validator

from armwright.arrays import Array
from armwright.exceptions import SpaceError, did_you_mean
from armwright.robot.arm import Arm
from armwright.spaces import design_matrix
from armwright.spaces.arm_builder import build_arm, design_modules
from armwright.spaces.design_parameters import check_parameters, checked_design, parameters_by_name, parameters_of
from armwright.spaces.joint_modules import Module
from armwright.spaces.parameters import Design, Parameter, ParameterValue
from armwright.spaces.space_schema import SpaceSchema
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
        return parameters_of(self)

    def is_free(self, name: str, params: Mapping[str, ParameterValue]) -> bool:
        """Return whether a parameter is active and not tied, given the values of the parameters before it."""
        return name not in dict(self.tie) and parameters_by_name(self)[name].is_active(params, self.max_joints)

    def condition(self, name: str) -> tuple[int, str] | None:
        """Return the module that a parameter requires and the types it may have; None if it is always active."""
        entry = parameters_by_name(self)[name]
        if entry.module is None:
            return None
        return entry.module, "".join(self.joint_types if entry.types is None else sorted(entry.types))

    def design(self, params: Mapping[str, Any]) -> Design:
        """Return the design with these values, in the order of the space.

        Tied values may be missing. Values of inactive parameters are left out.

        Raises:
            DesignError: If a value is unknown, missing or outside its range.
        """
        return checked_design(self, params)

    def free_values(self, design: Design) -> dict[str, ParameterValue]:
        """Return the values of a design that are not tied."""
        return {name: value for name, value in design.params.items() if name not in dict(self.tie)}

    def from_free_values(self, params: Mapping[str, ParameterValue]) -> Design:
        """Return the design with these free values."""
        given = {**params, **{name: params[other] for name, other in self.tie if other in params}}
        return Design({p.name: given[p.name] for p in self.parameters if p.name in given})

    def clipped(
        self, origin: Iterable[float], joints: str, links: Iterable[float], like: Design | None = None
    ) -> Design:
        """Return the design with these numbers, each moved into its range.

        Args:
            origin: (3,) base position [m].
            joints: The letters of the joint modules.
            links: (D,) link lengths [m].
            like: The source of all other values; defaults for those that it lacks.
        """
        return design_matrix.clip(self, origin, joints, links, like)

    def matrix(self, designs: Sequence[Design]) -> Array:
        """Return the (N, P) matrix of N designs; a choice is represented by its index."""
        return design_matrix.encode(self, designs)

    def designs(self, matrix: Array) -> list[Design]:
        """Return the designs of the (N, P) rows of a matrix."""
        return design_matrix.decode(self, matrix)

    def normalised(self, matrix: Array) -> Array:
        """Return the (N, P) rows as `matrix` would: tied values equal, inactive parameters at their defaults."""
        return design_matrix.normalise(self, matrix)

    def sample(self, n: int, seed: int) -> list[Design]:
        """Return `n` designs, uniform in every parameter."""
        return design_matrix.sample(self, n, seed)

    def modules(self, design: Design) -> tuple[Module, ...]:
        """Return the joint modules of a design, in order."""
        return design_modules(design)

    def joint_modules(self, design: Design) -> tuple[int, ...]:
        """Return the index of its module for each joint of a design."""
        return tuple(i for i, module in enumerate(design_modules(design)) for _ in module.joints)

    def arm(self, design: Design) -> Arm:
        """Return the physical chain that a design builds."""
        return build_arm(self, design)

    @property
    def is_toy(self) -> bool:
        """Whether even the heaviest arm is nearly massless, as in the paper."""
        heaviest = max((record.mass for record in self.actuators), default=0.0)
        return self.max_joints * (self.mass.mass(self.link[1]) + heaviest) < TOY_MASS

    @property
    def mass_note(self) -> str:
        """One sentence on the assumed masses; it accompanies all torques."""
        toy = "; a toy: real arms weigh kilograms, so read its N m as a comparison only" if self.is_toy else ""
        names = ", ".join(record.name for record in self.actuators)
        actuators = f"; actuators: {names}" if self.actuators else ""
        return f"links: {self.mass.description}{toy}{actuators}"


def paper_space(joints: int = 4) -> DesignSpace:
    """Return the design space of the paper.

    Args:
        joints: The number of joints, 4 in the experiments of the paper.

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
