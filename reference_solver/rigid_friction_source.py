"""The equations of ``rigid_friction`` as straight-line code: one more row per following joint, and friction.

Without friction they are those of ``generator`` as they are.
"""

from reference_solver.contact_laws import FrictionLaw
from reference_solver.equations import Baumgarte
from reference_solver.generator import EquationsWriter
from reference_solver.mechanism import GROUND
from reference_solver.mechanism_source import SIDES, Ends
from reference_solver.rigid_friction import LEAST_MOBILITY, FollowingEquations, steepest
from reference_solver.rigid_joint import FloatArray, RigidJoint
from reference_solver.straight_line import ONE, ZERO, Sparse, StraightLine, dot, negative, product, total


class FollowingWriter(EquationsWriter):
    """Writes the equations of a mechanism whose last rows belong to the joints in ``following``."""

    def __init__(
        self,
        equations: FollowingEquations,
        joints: tuple[RigidJoint, ...],
        following: tuple[int, ...],
        q_start: FloatArray,
    ) -> None:
        super().__init__(equations.held, q_start)
        self._first = self.m - len(following)
        self.joints, self.following = joints, following
        self._rubbing = [
            (self._first + i, joints[k], friction)
            for i, k in enumerate(following)
            if (friction := joints[k].friction) is not None
        ]

    @property
    def rates(self) -> list[str]:
        """Names of the powers lost in friction, in the order of ``following``, and of the damper's rate."""
        return [*(f"lost{row}" for row, *_ in self._rubbing), "damping"] if self._rubbing else []

    def row_of(self, joint: int) -> int:
        """Return the row of a joint that follows."""
        return int(self._first + self.following.index(joint))

    def accelerations(self, baumgarte: Baumgarte | None) -> tuple[StraightLine, list[str], list[str], str]:
        """Return the code, the names of accelerations and multipliers, and its condition (see the base)."""
        code, accelerations, lambda_, ok = super().accelerations(baumgarte)
        if not self._rubbing:
            return code, accelerations, lambda_, ok
        BW, factors = self.factors(code, self.rows(code))  # written before: no line is added
        T, sliding, s, X, answer = [], [], [], [], []
        for row, joint, friction in self._rubbing:
            T.append(self._sliding_row(code, row, joint))
            sliding.append(code.let(f"sliding{row}", total(product(e, f"v{c}") for c, e in T[-1].items())))
            s.append(code.let(f"share{row}", self._share(row, joint, friction, sliding[-1])))
            right = {r: code.let(f"t{row}_{r}", dot(BW[r], T[-1])) for r in range(self.m)}
            X.append(factors.solve(f"x{row}_", right))
            answer.append(
                [
                    code.let(
                        f"y{row}_{c}",
                        total(
                            [
                                product(T[-1].get(c, ZERO), self.inverse_mass(c)),
                                *(negative(product(BW[r][c], x)) for r, x in X[-1].items() if c in BW[r]),
                            ]
                        ),
                    )
                    for c in range(self.n)
                ]
            )
        rows = [row for row, *_ in self._rubbing]
        small = [
            [
                code.let(f"m{a}_{b}", total([ONE if a == b else ZERO, product(s[i], X[k][a])]))
                for k, b in enumerate(rows)
            ]
            for i, a in enumerate(rows)
        ]
        right = {a: code.let(f"e{a}", product(s[i], lambda_[a])) for i, a in enumerate(rows)}
        tau, pivots = _eliminated(code, rows, small, [right[a] for a in rows])
        lambda_ = [
            code.let(
                f"held{r}",
                total([lambda_[r], *(negative(product(x[r], z)) for x, z in zip(X, tau, strict=True))]),
            )
            for r in range(self.m)
        ]
        accelerations = [
            code.let(
                f"b{c}",
                total([accelerations[c], *(product(y[c], z) for y, z in zip(answer, tau, strict=True))]),
            )
            for c in range(self.n)
        ]
        dampers = []
        for i, (row, joint, friction) in enumerate(self._rubbing):
            code.lines.append(f"lost{row} = -{tau[i]}*{sliding[i]}")
            most = joint.radial_clearance_m * friction.coefficient * steepest(friction)
            mobility = code.let(f"along{row}", total(product(e, answer[i][c]) for c, e in T[i].items()))
            slope = self.parameter(f"steepest {row}", most)
            dampers.append(f"{slope}*max(-{lambda_[row]}, 0.0)*{mobility}/{small[i][i]}")
        code.lines.append(f"damping = {total(dampers)}")
        conditions = [f"({pivot} > {LEAST_MOBILITY!r})" for pivot in pivots]
        return code, accelerations, lambda_, code.let("mobile", " & ".join([ok, *conditions]))

    def _sliding_row(self, code: StraightLine, row: int, joint: RigidJoint) -> Sparse:
        """Return T, the row that gives the sliding speed from {q'}."""
        ends: Ends = (joint.body_i, joint.point_i), (joint.body_j, joint.point_j)
        arms, (x, y), _ = self.between(code, f"f{row}", ends)
        length = code.let(f"f{row}_length", f"sqrt({x}*{x} + {y}*{y})")
        n_x, n_y = code.let(f"f{row}_nx", f"{x}/{length}"), code.let(f"f{row}_ny", f"{y}/{length}")
        radii = (-joint.bearing_radius_m, joint.bearing_radius_m - joint.radial_clearance_m)
        T: Sparse = {}
        for (side, sign), (body, _), arm, radius in zip(SIDES, ends, arms, radii, strict=True):
            if body == GROUND:
                continue
            turn = [product(sign, arm[0], n_x), product(sign, arm[1], n_y)]
            turn.append(self.parameter(f"radius {row}{side}", radius))
            T[3 * body], T[3 * body + 1] = negative(product(sign, n_y)), product(sign, n_x)
            T[3 * body + 2] = code.let(f"f{row}_turn_{side}", total(turn))
        return T

    def _share(self, row: int, joint: RigidJoint, friction: FrictionLaw, sliding: str) -> str:
        """Return the code of mu c f(v_t)."""
        size = self.parameter(f"friction {row}", friction.coefficient * joint.radial_clearance_m)
        full = self.parameter(f"full friction {row}", friction.regularisation_speed_m_s)
        if friction.kind == "tanh":
            return f"{size}*tanh({sliding}/{full})"
        if friction.kind == "saturated-linear":
            return f"{size}*min(1.0, max(-1.0, {sliding}/{full}))"
        dead = self.parameter(f"dead band {row}", friction.dead_band_speed_m_s)
        ramp = f"min(1.0, max(0.0, (abs({sliding}) - {dead})/({full} - {dead})))"
        return f"{size}*copysign({ramp}, {sliding})"


def _eliminated(
    code: StraightLine, rows: list[int], matrix: list[list[str]], right: list[str]
) -> tuple[list[str], list[str]]:
    """Return the solution of a small system by Gauss's elimination in the given order, and the pivots."""
    A, z, size = [row.copy() for row in matrix], right.copy(), len(rows)
    for k in range(size):
        for i in range(k + 1, size):
            factor = code.let(f"o{rows[i]}_{rows[k]}", f"{A[i][k]}/{A[k][k]}")
            for j in range(k + 1, size):
                update = negative(product(factor, A[k][j]))
                A[i][j] = code.let(f"o{rows[i]}_{rows[j]}_{rows[k]}", total([A[i][j], update]))
            z[i] = code.let(f"oz{rows[i]}_{rows[k]}", total([z[i], negative(product(factor, z[k]))]))
    for k in reversed(range(size)):
        known = [negative(product(A[k][j], z[j])) for j in range(k + 1, size)]
        z[k] = code.let(f"tau{rows[k]}", f"({total([z[k], *known])})/{A[k][k]}")
    return z, [A[k][k] for k in range(size)]
