"""What a joint of an arm may do, in the words of URDF; SDF and ros2_control have the same."""

from armwright.arm import Joint

# A moving joint must state both; without an actuator they only have to be out of the way.
EFFORT = 100.0  # [N m] or [N]
VELOCITY = 10.0  # [rad/s] or [m/s]


def limits_of(joint: Joint) -> dict[str, float]:
    """lower, upper [rad] or [m], effort [N m] or [N] and velocity [rad/s] or [m/s]; the latter two its actuator's."""
    effort = EFFORT if joint.effort is None else joint.effort
    velocity = VELOCITY if joint.speed is None else joint.speed
    return {"lower": joint.lower, "upper": joint.upper, "effort": effort, "velocity": velocity}


def home_of(joint: Joint) -> float:
    """0, or the limit that is nearest to it [rad] or [m]."""
    return min(max(0.0, joint.lower), joint.upper)
