"""Impacts of rigid joints: the jump of {q'} when pins hit their walls while all ideal joints hold.

N are the rows of inward normal speed u_n at the joints that touch, T those of tangential speed u_t, D both.
The impulses Lambda obey  u+ = u- + W Lambda,  W = D ([M]^-1 - [M]^-1 B^T G^-1 B [M]^-1) D^T,
G = B [M]^-1 B^T: the impulses of the ideal joints are eliminated. For one frictionless contact this is

    q'+ = q'- - (1 + e) [M]^-1 B^T (B [M]^-1 B^T)^-1 (B q'-)_n

with the contact's row in B and e applied to that row only, and the loss is (1 - e^2)/2 v_n^2/W_nn.

* Normal: Newton's law with complementarity (Moreau 1988; Pfeiffer and Glocker 1996): all pins that touch take
  part at once,  Lambda_n >= 0,  u_n+ + e u_n- >= 0,  one of them zero; e = 0 where a pin does not approach.
* Tangential: Coulomb's law on the impulse (Whittaker 1904; Kane and Levinson 1985): the impulse that leaves
  u_t+ = 0 if it is at most mu Lambda_n, else mu Lambda_n against the sliding that remains.
* That law can create energy where normal and tangential motion are coupled (Kane 1984). Then the impulses
  are moved back towards the frictionless ones, Lambda = (1 - s) Lambda_0 + s Lambda_1, with the largest s at
  which the kinetic energy does not grow: both ends keep the laws' signs and limits, and so does every s.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from reference_solver.equations import Equations
from reference_solver.failures import BlockedImpact
from reference_solver.rigid.complementarity import complementary
from reference_solver.tape import FloatArray

#: A contact row that is this small a part of itself once the ideal joints are eliminated depends on them.
DEPENDENT = 1e-12
#: Relative slack of signs and limits when a case of sticking or sliding is judged.
SLACK = 1e-10
#: The sign of the sliding in the cases without sticking.
SIGNS = {"slide -": -1, "slide +": 1, "open": 0}


@dataclass(frozen=True)
class Touching:
    """The k joints that touch: rows of normal speed (inward) and tangential speed (k, n), e and mu (k,)."""

    normal: FloatArray
    tangent: FloatArray
    restitution: FloatArray
    friction: FloatArray


@dataclass(frozen=True)
class Jump:
    """An impact: {q'} after it (n,), the joints' impulses and losses (k,), and the drivers' work.

    ``effective_mass_kg`` is 1/W_nn of each contact on its own.
    """

    v: FloatArray
    normal_impulse_N_s: FloatArray
    tangential_impulse_N_s: FloatArray
    energy_lost_J: FloatArray
    effective_mass_kg: FloatArray
    driver_work_J: float


class Eliminated:
    """The mechanism's answer to impulses or forces along rows D (k, n), its ideal joints holding, at q.

    The first ``normals`` rows have to leave it some motion.
    """

    def __init__(self, equations: Equations, t: float, q: FloatArray, D: FloatArray, normals: int) -> None:
        factors = equations.factors(equations.constraint_matrix(q))
        if not factors.ok:
            equations.refuse_singular(t, q)
        #: {q'} per unit of each (n, k); the ideal joints' multipliers per unit of each (m, k).
        self.motion, self.reactions = factors.solve(D.T, np.zeros((len(equations.C), len(D))))
        W = D @ self.motion
        #: W (k, k), the speeds along the rows per unit of each.
        self.W = (W + W.T) / 2
        blocked = self.W.diagonal() < DEPENDENT * (D * D @ equations.inverse_mass)
        if blocked[:normals].any():
            raise BlockedImpact(t)


def impact(equations: Equations, t: float, q: FloatArray, v: FloatArray, touching: Touching) -> Jump:
    """Return the jump of v at q by the laws above.

    Raises:
        BlockedImpact: the ideal joints leave a pin no motion along the line of centres.
        SingularConfiguration: the ideal joints' rows are dependent.
    """
    k = len(touching.normal)
    rubbing = touching.friction > 0
    D = np.concatenate([touching.normal, touching.tangent[rubbing]])
    eliminated = Eliminated(equations, t, q, D, k)
    W, u = eliminated.W, D @ v
    impulse = np.zeros(len(D))
    impulse[:k] = complementary(W[:k, :k], (1 + touching.restitution) * u[:k])
    if rubbing.any() and impulse.any():
        rubbed = _with_friction(W, u, touching, np.flatnonzero(rubbing))
        if rubbed is not None:
            impulse = _not_growing(W, u, impulse, rubbed)
    mean = u + W @ impulse / 2
    losses = -(impulse * mean)
    lost = losses[:k].copy()
    lost[rubbing] += losses[k:]
    tangential = np.zeros(k)
    tangential[rubbing] = impulse[k:]
    return Jump(
        v + eliminated.motion @ impulse,
        impulse[:k],
        tangential,
        lost,
        1 / W.diagonal()[:k],
        float(eliminated.reactions.T @ equations.speeds(t) @ impulse),
    )


def _with_friction(
    W: FloatArray, u: FloatArray, touching: Touching, rubbing: NDArray[np.int_]
) -> FloatArray | None:
    """Return the impulses (normal, then tangential) of the first case that keeps its conditions, or None."""
    k, wanted = len(touching.normal), touching.restitution
    place = {int(contact): k + i for i, contact in enumerate(rubbing)}
    cases = [("stick", "slide -", "slide +", "open") if c in place else ("slide +", "open") for c in range(k)]
    speed_slack = SLACK * np.abs(u).max()
    for case in product(*cases):
        # One condition per unknown: rows of A Lambda = a.
        A, a = np.eye(len(u)), np.zeros(len(u))
        for c, state in enumerate(case):
            if state != "open":
                A[c], a[c] = W[c], -(1 + wanted[c]) * u[c]
            if c in place and state == "stick":
                A[place[c]], a[place[c]] = W[place[c]], -u[place[c]]
            elif c in place:
                A[place[c], c] = -touching.friction[c] * SIGNS[state]
        try:
            impulse = np.asarray(np.linalg.solve(A, a), dtype=np.float64)
        except np.linalg.LinAlgError:
            continue
        after, slack = u + W @ impulse, SLACK * np.abs(impulse).max()
        if np.any(impulse[:k] < -slack) or np.any(after[:k] + wanted * u[:k] < -speed_slack):
            continue
        # Sticking is within Coulomb's limit, or sliding is opposed.
        if all(
            abs(impulse[row]) <= touching.friction[c] * impulse[c] + slack
            if case[c] == "stick"
            else after[row] * SIGNS[case[c]] <= speed_slack
            for c, row in place.items()
        ):
            return impulse
    return None


def _not_growing(W: FloatArray, u: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the impulses nearest ``end`` on the line from ``start`` at which the energy has not grown."""

    def growth(impulse: FloatArray) -> float:
        return float(impulse @ (u + W @ impulse / 2))

    if growth(end) <= 0:
        return end
    # The growth is g0 + s g1 + s^2 g2 with g0 <= 0 and g2 >= 0: one root in [0, 1].
    way = end - start
    g0, g1, g2 = growth(start), float(way @ (u + W @ start)), float(way @ W @ way) / 2
    root = np.sqrt(max(g1 * g1 - 4 * g0 * g2, 0.0))
    s = -2 * g0 / (g1 + root) if g1 > 0 else (root - g1) / (2 * g2)
    return np.asarray(start + min(max(s, 0.0), 1.0) * way)
