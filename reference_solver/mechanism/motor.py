"""A motor's torque, which is linear in its speed, of whatever has the two points that give it."""

from typing import Protocol

from reference_solver.tape import Scalar


class Motor(Protocol):
    """The torque at rest, and the speed at which there is none."""

    @property
    def stall_torque_N_m(self) -> float: ...  # noqa: D102

    @property
    def no_load_speed_rad_s(self) -> float: ...  # noqa: D102


def motor_torque(motor: Motor, speed_rad_s: Scalar) -> Scalar:
    """Return the torque in N m at a speed, or at an array of them."""
    return motor.stall_torque_N_m * (1.0 - speed_rad_s / motor.no_load_speed_rad_s)


def motor_damping(motor: Motor) -> float:
    """Return c in N m s of the damper, against a body that turns at the no-load speed, that a motor is."""
    return motor.stall_torque_N_m / motor.no_load_speed_rad_s
