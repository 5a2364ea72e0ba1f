"""Values of a URDF that no real arm has.

The principal moments a <= b <= c of a body meet a + b >= c, and its radius of gyration, at most sqrt(c / mass), is
within its outline.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from armwright.robot.arm import Arm
from armwright.robot.urdf_xml import UrdfLink
from armwright.text import listed

SAME_EFFORT = 200.0  # [N m]; all joints of small arms may have the same motor, those of large arms do not
LIGHTEST, HEAVIEST, DESK = 2e-3, 20.0, 1.0  # of a body [kg]; the latter of arms that are at most so long [m]
ROUNDING = 1e-2  # of the largest principal moment
HOUSING, OUTLINE = 0.1, 2.0  # the outline of a link: around it [m], and relative to its length and centre of mass


def implausible(arm: Arm, bodies: Sequence[Sequence[UrdfLink]]) -> Iterator[str]:
    """Yield notes on efforts, masses and inertias of an arm; bodies: the links that move with each joint."""
    efforts = {joint.effort for joint in arm.joints if joint.coupling is None}
    if len(efforts) == 1 < len(arm.joints) and (effort := efforts.pop() or 0.0) >= SAME_EFFORT:
        yield f"every joint states the same effort, {effort:g}, which is probably made up"
    heaviest = HEAVIEST if arm.length <= DESK else np.inf
    parts = list(zip(arm.links, bodies, strict=True))
    masses = [(body[0].name, link.total_mass) for link, body in parts if not link.without_mass]
    if odd := [f"{name} {mass:g} kg" for name, mass in masses if not LIGHTEST <= mass <= heaviest]:
        yield f"masses that a link hardly has: {listed(odd)}"
    if names := [one.name for link, body in parts for one in body if not _is_body(one, link.length)]:
        yield f"inertias that no body of that mass has: {listed(names)}"


def _is_body(link: UrdfLink, length: float) -> bool:
    """Return True if a body of the mass and length [m] of a link can have its inertia."""
    least, middle, largest = np.linalg.eigvalsh(link.inertia)
    outline = HOUSING + OUTLINE * max(length, float(np.linalg.norm(link.com)))
    is_tensor = least >= -ROUNDING * largest and least + middle >= (1.0 - ROUNDING) * largest
    return bool(is_tensor and largest <= link.mass * outline**2)
