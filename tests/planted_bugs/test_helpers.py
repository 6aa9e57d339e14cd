"""What tests judge by is judged: it takes what is right, and nothing else."""

import pytest

from tests.helpers.orders import ORDER_TOLERANCE, slope
from tests.helpers.refusals import require_refusal


@pytest.mark.parametrize(
    ("stdout", "stderr", "code"),
    [
        ("", "error: x: expected y\n", 1),
        ("", "error: x: expected y\n", 0),
        ("1,2\n", "error: x: expected y\n", 2),
        ("", "x: expected y\n", 2),
        ("", "error: x: expected y\nmore\n", 2),
        ("", "error: x\n", 2),
    ],
)
def test_what_is_no_refusal_is_not_taken_for_one(stdout: str, stderr: str, code: int) -> None:
    require_refusal("", "error: x: expected y\n", 2, "expected y")
    with pytest.raises(AssertionError):
        require_refusal(stdout, stderr, code, "expected y")


def test_an_order_is_told_from_one_a_tenth_off() -> None:
    steps = (1.0, 0.5, 0.25)
    for order in (1.0, 3.9, 4.0):
        assert slope(steps, [h**order for h in steps]) == pytest.approx(order)
    assert ORDER_TOLERANCE <= 0.05
