"""What a member of an ensemble did, in numbers that hold past the horizon: averages over revolutions.

Impacts within a member are correlated, so a member is one draw of each number, and intervals and tests are
made over members.
"""

import numpy as np

from engine_models.engine import Trajectory
from engine_models.scene.scene import Scene
from studies.judges.ideal_truth import slider_position_m
from studies.running.case import Curves, Row


def period_s(scene: Scene) -> float:
    """Return the time of a revolution of a crank at constant speed.

    Raises:
        ValueError: the crank is not driven at constant speed, or stands still.
    """
    if scene.drive.kind != "constant-speed" or scene.start.crank_speed_rad_s == 0:
        raise ValueError(f"scene {scene.name}: expected a crank that turns at constant speed")
    return 2 * np.pi / abs(scene.start.crank_speed_rad_s)


def statistics(scene: Scene, run: Trajectory, from_s: float) -> tuple[Row, Curves]:
    """Return a driven member's numbers from a time on, which is a sample's, and the impacts behind them.

    Joints with clearance are taken together: impulses and losses are summed, impacts pooled, the fraction of
    time in flight is the mean over joints and samples. The phase of an impact is the crank angle at touch;
    its mean is that of cosine and sine, since angles go round. The slider's deviation is from where ideal
    joints would put it at the crank's angle.
    """
    first = int(np.searchsorted(run.time_s, from_s * (1 - 1e-9)))
    revolutions = (run.time_s[-1] - run.time_s[first]) / period_s(scene)
    contacts = run.contacts.values()
    time, speed = (
        np.concatenate([getattr(contact.impacts, name) for contact in contacts])
        for name in ("time_s", "approach_speed_m_s")
    )
    late = time >= run.time_s[first]
    phase = (scene.start.crank_angle_rad + scene.start.crank_speed_rad_s * time[late]) % (2 * np.pi)
    impulse = sum(contact.normal_impulse_N_s for contact in contacts)
    lost = run.dissipated_energy_J
    assert isinstance(impulse, np.ndarray)
    assert lost is not None
    deviation = run.slider_position_m - slider_position_m(scene, run.position[:, 0, 2])
    row: Row = {
        "revolutions": float(revolutions),
        "impacts_per_revolution": float(late.sum() / revolutions),
        "impulse_per_revolution_N_s": float((impulse[-1] - impulse[first]) / revolutions),
        "dissipated_energy_per_revolution_J": float((lost[-1] - lost[first]) / revolutions),
        "free_flight_fraction": float(np.mean([c.penetration_m[first:] < 0 for c in contacts])),
        "slider_deviation_m": float(np.sqrt(np.mean(deviation[first:] ** 2))),
    }
    if late.any():
        row["impact_speed_m_s"] = float(speed[late].mean())
        row["impact_phase_cosine"] = float(np.cos(phase).mean())
        row["impact_phase_sine"] = float(np.sin(phase).mean())
    return row, {"impact_phase_rad": phase, "impact_speed_m_s": speed[late]}
