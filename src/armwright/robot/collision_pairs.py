"""Parts of an arm that touch by construction, so that their collisions do not count."""

from collections.abc import Iterator

from armwright.robot.arm import Arm


def joined_by_motors(arm: Arm) -> Iterator[tuple[int, int]]:
    """Yield pairs of a joint with a motor body and a solid link that need no collision check, counted from 0.

    A motor is a neighbour of the link that carries it, of the link that it moves, and of links without a solid link or
    a moving joint between. All other pairs count, and so do all pairs of motors.
    """
    solid = [n for n, link in enumerate(arm.links) if link.length > 0.0]
    for j, joint in enumerate(arm.joints):
        if joint.body is None:
            continue
        before, after = [n for n in solid if n < j], [n for n in solid if n >= j]
        for n in before:
            rigid = all(one.kind == "fixed" for one in arm.joints[n + 1 : j])
            if rigid or n == before[-1]:
                yield j, n
        if after:
            yield j, after[0]


def joined_by_tip(arm: Arm) -> tuple[list[int], list[int]]:
    """Return the motors, by joint, and the solid links that need no collision check with tool and payload.

    Tool and payload are parts of the last link. Its neighbours do not count, nor what is rigidly connected to it, nor a
    link whose round end reaches up to the tool.
    """
    solid = [n for n, link in enumerate(arm.links) if link.length > 0.0]
    motors = [j for j, joint in enumerate(arm.joints) if joint.body is not None and sum(n >= j for n in solid) < 2]
    links = [
        n for n in solid if n == solid[-1] or all(one.kind == "fixed" for one in arm.joints[n + 1 :])
        or sum(link.length for link in arm.links[n + 1 :]) <= arm.links[n].radius
    ]  # fmt: skip
    return motors, links


def joined_by_column(arm: Arm) -> tuple[list[int], list[int]]:
    """Return the motors, by joint, and the solid links that need no collision check with the column, counted from 0.

    These are the parts that do not move, and the first solid link. All others count.
    """
    first = next((j for j, joint in enumerate(arm.joints) if joint.kind != "fixed"), len(arm.joints))
    solid = [n for n, link in enumerate(arm.links) if link.length > 0.0]
    motors = [j for j, joint in enumerate(arm.joints[: first + 1]) if joint.body is not None]
    return motors, [n for n in solid if n < first or n == solid[0]]
