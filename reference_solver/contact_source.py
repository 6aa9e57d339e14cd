"""Contacts in the generated code: the force of a pin in its bearing, what it dissipates, how the gap changes.

d is the vector from bearing centre to pin centre, n = d/|d|, t = (-n_y, n_x), penetration |d| - c. The pin
gets -F_n n + F_t t. Both forces act at one point, in the middle of the penetration: R_i + delta/2 from the
bearing's centre and R_j - delta/2 from the pin's. The state of contact k is two inputs: its phase s[2k] (see
``contact_loop``) and s[2k + 1] = a/v0 of the law.
"""

from reference_solver.contact_laws import FrictionLaw
from reference_solver.mechanism import GROUND, ClearanceJoint
from reference_solver.mechanism_source import Arms, Ends, MechanismWriter, Terms
from reference_solver.straight_line import StraightLine, negative, product, total


def ends_of(joint: ClearanceJoint) -> Ends:
    """Return bearing centre and pin centre, each by body and place."""
    return (joint.body_i, joint.point_i), (joint.body_j, joint.point_j)


def rates(number: int, joint: ClearanceJoint) -> list[str]:
    """Return the names of what a contact adds up: normal force and losses.

    The losses are by the normal force, where it is clipped, and by friction.
    """
    clip, slide = joint.law.clipped, joint.friction is not None
    return [f"normal{number}", f"loss{number}"] + clip * [f"clip{number}"] + slide * [f"slide{number}"]


def write_contact(
    writer: MechanismWriter, code: StraightLine, number: int, joint: ClearanceJoint, terms: Terms
) -> None:
    """Add the force of contact ``number`` to the accelerations' terms, and name its ``rates``, in N and W."""
    k, ends = number, ends_of(joint)
    arms, (x, y), (rate_x, rate_y) = writer.between(code, f"n{k}", ends)
    clearance = writer.parameter(f"clearance {k}", joint.radial_clearance_m)
    names = [f"force_x{k}", f"force_y{k}", *rates(k, joint)]
    inside = [
        f"distance{k} = sqrt({x}*{x} + {y}*{y})",
        f"n_x{k}, n_y{k} = {x}/distance{k}, {y}/distance{k}",
        f"depth{k} = max(distance{k} - {clearance}, 0.0)",
        f"rate{k} = n_x{k}*{rate_x} + n_y{k}*{rate_y}",
        *_normal(writer, k, joint),
    ]
    force_x, force_y = f"-normal{k}*n_x{k}", f"-normal{k}*n_y{k}"
    twist = ("0.0", "0.0")
    if joint.friction is not None:
        inside += _friction(writer, k, joint, joint.friction, (rate_x, rate_y))
        force_x += f" - tangential{k}*n_y{k}"
        force_y += f" + tangential{k}*n_x{k}"
        twist = (f"twist_i{k}", f"twist_j{k}")
        names += twist
    inside += [f"force_x{k} = {force_x}", f"force_y{k} = {force_y}"]
    code.lines += [f"{name} = 0.0" for name in names]
    code.lines += [f"if s[{2 * k}] > 0.0:", *(f"    {line}" for line in inside)]
    writer.push(ends, arms, (f"force_x{k}", f"force_y{k}"), terms, twist)


def write_elastic(
    writer: MechanismWriter, code: StraightLine, number: int, joint: ClearanceJoint, terms: Terms
) -> None:
    """Add to the accelerations' terms what contact ``number`` pushes with at rest, clipped or not."""
    k, ends = number, ends_of(joint)
    arms, (x, y) = writer.reach(code, f"n{k}", ends)
    clearance = writer.parameter(f"clearance {k}", joint.radial_clearance_m)
    code.lines += [
        f"pull{k} = 0.0",
        f"if s[{2 * k}] > 0.0:",
        f"    distance{k} = sqrt({x}*{x} + {y}*{y})",
        f"    depth{k} = max(distance{k} - {clearance}, 0.0)",
        f"    pull{k} = -{_spring(writer, k, joint)}/distance{k}",
    ]
    writer.push(ends, arms, (f"pull{k}*{x}", f"pull{k}*{y}"), terms)


def _spring(writer: MechanismWriter, k: int, joint: ClearanceJoint) -> str:
    """Return K delta^n."""
    stiffness = writer.parameter(f"stiffness {k}", joint.law.stiffness)
    power = {1.0: f"depth{k}", 1.5: f"depth{k}*sqrt(depth{k})"}.get(joint.law.exponent)
    return f"{stiffness}*{power or f'depth{k}**' + writer.parameter(f'exponent {k}', joint.law.exponent)}"


def _normal(writer: MechanismWriter, k: int, joint: ClearanceJoint) -> list[str]:
    law = joint.law
    normal, loss = [f"spring{k}"], []
    if law.damping_factor:
        normal.append(f"spring{k}*s[{2 * k + 1}]*rate{k}")
        loss.append(f"spring{k}*s[{2 * k + 1}]*rate{k}*rate{k}")
    if law.damping_N_s_m:
        damping = writer.parameter(f"damping {k}", law.damping_N_s_m)
        normal.append(f"{damping}*rate{k}")
        loss.append(f"{damping}*rate{k}*rate{k}")
    clipped = [
        f"if s[{2 * k}] == 2.0:",  # the law would pull: no force, and the spring's energy is lost
        f"    normal{k}, loss{k}, clip{k} = 0.0, 0.0, -spring{k}*rate{k}",
    ]
    return [
        f"spring{k} = {_spring(writer, k, joint)}",
        f"normal{k} = {total(normal)}",
        f"loss{k} = {total(loss)}",
        *(clipped if law.clipped else []),
        f"if s[{2 * k}] == 3.0:",  # a probe for the gap's mobility
        f"    normal{k}, loss{k} = 1.0, 0.0",
    ]


def _friction(
    writer: MechanismWriter, k: int, joint: ClearanceJoint, friction: FrictionLaw, rate: tuple[str, str]
) -> list[str]:
    coefficient = writer.parameter(f"friction {k}", friction.coefficient)
    full = writer.parameter(f"full friction {k}", friction.regularisation_speed_m_s)
    spins = [f"v{3 * body + 2}" if body != GROUND else "0.0" for body in (joint.body_i, joint.body_j)]
    bearing = writer.parameter(f"bearing {k}", joint.bearing_radius_m)
    pin = writer.parameter(f"pin {k}", joint.bearing_radius_m - joint.radial_clearance_m)
    sliding = [f"n_x{k}*{rate[1]} - n_y{k}*{rate[0]}", product(spins[1], f"arm_j{k}")]
    sliding.append(negative(product(spins[0], f"arm_i{k}")))
    # Where a law pulls, friction with the force's sign drives the sliding (Exudyn's contact has it so).
    pressing = f"normal{k}" if joint.law.may_pull else f"max(normal{k}, 0.0)"
    if friction.kind == "tanh":
        share = f"tanh(sliding{k}/{full})"
    elif friction.kind == "saturated-linear":
        share = f"min(1.0, max(-1.0, sliding{k}/{full}))"
    else:
        dead = writer.parameter(f"dead band {k}", friction.dead_band_speed_m_s)
        share = f"copysign(min(1.0, max(0.0, (abs(sliding{k}) - {dead})/({full} - {dead}))), sliding{k})"
    return [
        f"arm_i{k}, arm_j{k} = {bearing} + 0.5*depth{k}, {pin} - 0.5*depth{k}",
        f"sliding{k} = {total(sliding)}",
        f"tangential{k} = -{coefficient}*{pressing}*{share}",
        f"slide{k} = -tangential{k}*sliding{k}",
        f"twist_i{k}, twist_j{k} = -arm_i{k}*tangential{k}, arm_j{k}*tangential{k}",
    ]


def gap_lines(writer: MechanismWriter, number: int, joint: ClearanceJoint) -> list[str]:
    """Return code for the row ``out[number]``: g, its rate, the speed of the pin centre, and the penetration.

    g = (d.d - c^2)/(2c), polynomial in d, has the sign of the penetration and its slope at touch.
    """
    code = StraightLine()
    _, (x, y), (rate_x, rate_y) = writer.between(code, f"n{number}", ends_of(joint))
    c = writer.parameter(f"clearance {number}", joint.radial_clearance_m)
    return [
        *code.lines,
        f"out[{number}, 0] = 0.5*({x}*{x} + {y}*{y} - {c}*{c})/{c}",
        f"out[{number}, 1] = ({x}*{rate_x} + {y}*{rate_y})/{c}",
        f"out[{number}, 2] = sqrt({rate_x}*{rate_x} + {rate_y}*{rate_y})",
        f"out[{number}, 3] = sqrt({x}*{x} + {y}*{y}) - {c}",
    ]


def gap_acceleration_lines(writer: MechanismWriter, number: int, joint: ClearanceJoint) -> list[str]:
    """Return code for ``out[number]``: the part of g's second derivative that is linear in accelerations."""
    code = StraightLine()
    arms, (x, y), _ = writer.between(code, f"n{number}", ends_of(joint))
    terms = _pin_acceleration(ends_of(joint), arms)
    c = writer.parameter(f"clearance {number}", joint.radial_clearance_m)
    return [*code.lines, f"out[{number}] = ({x}*({terms[0]}) + {y}*({terms[1]}))/{c}"]


def _pin_acceleration(ends: Ends, arms: Arms) -> list[str]:
    parts: tuple[list[str], list[str]] = ([], [])
    for sign, (body, _), arm in zip(("-1.0", "1.0"), ends, arms, strict=True):
        if body == GROUND:
            continue
        x, y, phi = (f"a{column}" for column in range(3 * body, 3 * body + 3))
        parts[0].extend([product(sign, x), negative(product(sign, phi, arm[1]))])
        parts[1].extend([product(sign, y), product(sign, phi, arm[0])])
    return [total(terms) for terms in parts]
