"""A native contact of Pymunk between rigid walls: a circle in a circle, its contact rewritten, compiled.

Pymunk knows no hollow circle: a pin's circle inside its bearing's overlaps it, and would be thrown out. Its
contact is there in every step, though, and may be changed before it is solved. In flight it is ignored; past
the wall it gets the normal and the points of a pin that touches its bearing from inside. From there on all is
Pymunk's own: restitution, Coulomb friction, the pin's penetration, and the sweeps over contacts and joints.

The other native ways are worse. A slide joint as long as the clearance has neither restitution nor friction.
A ring of segments is a polygon with corners: with 16 to 64 of them impulses are off by tens of per cent
however short the step, with 256 a step takes 0.7 ms. As everywhere in Pymunk, Newton's restitution and
Coulomb's friction know nothing of energy: an impact that turns the sliding round may create some (Kane 1984).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pymunk
from numba import types
from numpy.typing import NDArray
from pymunk._chipmunk_cffi import ffi, lib
from pymunk.batch import ArbiterFields

from engine_models.kernels import callback
from engine_models.pymunk.compiled.native_callbacks import NATIVE, record, rewrite
from engine_models.pymunk.exchange import STATE, Batch, address
from engine_models.scene.format import Clearance
from reference_solver.mechanism.data import Point

#: Of a collision, a space and the handler's data.
CALLBACK = types.void(types.uintp, types.uintp, types.uintp)


class NativeContact:
    """The two circles of a pin's contact in a space, and all memory that their collision's functions use."""

    def __init__(
        self,
        space: pymunk.Space,
        number: int,
        clearance: Clearance,
        ends: Sequence[tuple[pymunk.Body, Point]],
        run: NDArray[Any],
        record_of_pin: NDArray[Any],
        kicks: NDArray[Any],
    ) -> None:
        """Add to a space the contact of a pin, by its ``number``, in its bearing.

        The ``ends`` are the bodies of bearing and pin with the places of both on them. ``run`` and
        ``record_of_pin`` are records (1,).
        """
        (bearing_body, bearing_at), (pin_body, pin_at) = ends
        radius = clearance.bearing_radius_m
        bearing = pymunk.Circle(bearing_body, radius, bearing_at)
        inside = pymunk.Circle(pin_body, radius - clearance.radial_clearance_m, pin_at)
        kinds = 2 * number + 1, 2 * number + 2
        for shape, kind in zip((bearing, inside), kinds, strict=True):
            shape.collision_type = kind  # no mass: bodies have their own, and one set here would replace it
            shape.filter = pymunk.ShapeFilter(categories=1 << number, mask=1 << number)
            shape.elasticity = shape.friction = 1.0  # a pair's are the products of both
        bearing.elasticity = clearance.restitution or 0.0
        bearing.friction = clearance.friction.coefficient if clearance.friction is not None else 0.0
        space.add(bearing, inside)
        self._state, self._impulse = Batch(STATE, 12), Batch(ArbiterFields.TOTAL_IMPULSE, 2)
        self._points, self._kept = ffi.new("cpContactPointSet *"), (run, record_of_pin, kicks)
        native = self._record = np.zeros(1, NATIVE)
        native["run"], native["pin"], native["kicks"] = (address(array) for array in self._kept)
        native["bearing_body"], native["pin_body"] = (address(body._body) for body, _ in ends)
        native["state"], native["at"] = self._state.record, address(self._state.numbers)
        native["impulse"], native["impulse_at"] = self._impulse.record, address(self._impulse.numbers)
        native["points"] = address(self._points)
        native["closing_speed"] = clearance.minimum_impact_speed_m_s or 0.0
        self._functions = callback(rewrite, CALLBACK), callback(record, CALLBACK)
        handler = lib.cpSpaceAddCollisionHandler(space._space, *kinds)
        handler.preSolveFunc, handler.postSolveFunc = (
            ffi.cast(f"cpCollision{when}SolveFunc", function.address)
            for when, function in zip(("Pre", "Post"), self._functions, strict=True)
        )
        handler.userData = ffi.cast("void *", address(native))
