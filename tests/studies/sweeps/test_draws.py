"""Which members a sweep has: grids in order, draws inside their ranges, the same for the same seed."""

import numpy as np
import pytest

from engine_models.scene.library import SCENES
from studies.predictability.sweeps.draws import Draw, Sample, drawn
from studies.predictability.sweeps.ranges import values_of
from studies.running.failures import BadInput

CLEARANCE, SPEED = "clearance.B.radial_clearance_m", "start.crank_speed_rad_s"
ANGLE = "start.crank_angle_rad"
SCENE = SCENES["clearance-driven-0.5mm"]()
#: A logarithm and its inverse are each right to some units in the last place.
ROUND_OFF = 1e-14


def members(draw: Draw, **texts: str) -> dict[str, np.ndarray]:
    fields = {CLEARANCE: texts.get("clearance"), SPEED: texts.get("speed")}
    return drawn(SCENE, {field: values_of(field, text) for field, text in fields.items() if text}, draw)


def test_a_grid_has_every_value_of_one_field_with_every_one_of_the_other_and_the_last_goes_fastest() -> None:
    grid = members(Draw(), clearance="1e-5,1e-4", speed="100:300:3")
    assert grid[CLEARANCE].tolist() == [1e-5] * 3 + [1e-4] * 3
    assert grid[SPEED].tolist() == [100.0, 200.0, 300.0] * 2


def test_a_logarithmic_range_has_equal_ratios_and_its_own_ends() -> None:
    values = members(Draw(), clearance="1e-5:1e-3:log:9")[CLEARANCE]
    assert (values[0], values[-1]) == (1e-5, 1e-3)
    np.testing.assert_allclose(values[1:] / values[:-1], 100 ** (1 / 8), rtol=ROUND_OFF)


@pytest.mark.parametrize("sample", ["random", "latin-hypercube", "sobol"])
def test_draws_lie_in_their_ranges_and_are_those_of_the_seed(sample: Sample) -> None:
    one, same, other = (
        members(Draw(sample, 37, seed=seed), clearance="1e-5:1e-3:log", speed="50:800") for seed in (5, 5, 6)
    )
    for field, (low, high) in {CLEARANCE: (1e-5, 1e-3), SPEED: (50.0, 800.0)}.items():
        assert len(one[field]) == 37
        assert ((one[field] >= low) & (one[field] <= high)).all()
        np.testing.assert_array_equal(one[field], same[field])
        assert (one[field] != other[field]).all()


def test_a_latin_hypercube_has_one_draw_in_each_of_as_many_strata() -> None:
    found = members(Draw("latin-hypercube", 40), clearance="1e-5:1e-3:log", speed="0:40")
    decades = (np.log10(found[CLEARANCE]) + 5) / 2 * 40
    assert sorted(np.floor(decades).astype(int)) == list(range(40))
    assert sorted(np.floor(found[SPEED]).astype(int)) == list(range(40))


def test_a_jitter_moves_each_start_by_no_more_than_it_says_and_repeats_the_grid() -> None:
    found = members(Draw(members=50, jitter=1e-6), clearance="1e-5,1e-4")
    moves = found[ANGLE] - SCENE.start.crank_angle_rad
    assert len(set(moves)) == 100
    assert -1e-6 <= moves.min() < -0.9e-6
    assert 0.9e-6 < moves.max() <= 1e-6
    assert found[CLEARANCE].tolist() == [1e-5] * 50 + [1e-4] * 50


def test_a_jitter_is_around_the_scenes_own_angle_and_of_the_seed() -> None:
    turned = SCENE.replace("start.crank_angle_rad", 0.7)
    one, other = (drawn(turned, {}, Draw(members=50, jitter=0.1, seed=seed))[ANGLE] for seed in (0, 1))
    assert np.abs(one - 0.7).max() <= 0.1
    assert (one != other).all()


@pytest.mark.parametrize(
    ("draw", "text", "pieces"),
    [
        (Draw(), "1e-3:1e-5:10", "expected a range that rises, got 0.001 to 1e-05"),
        (Draw(), "1e-3:1e-3:10", "expected a range that rises"),
        (Draw(), "0:1e-3:log:10", "expected numbers > 0 in a range with log, got 0"),
        (Draw(), "1e-5:1e-3:0", 'expected log or a count >= 2 behind the ends, got "0"'),
        (Draw(), "1e-5:1e-3", "expected a count behind the ends on a grid"),
        (Draw(), "1e-5:1e-3:log:10:5", "expected LOW:HIGH[:log][:COUNT]"),
        (Draw(), "1e-5:nan:3", 'got "nan"'),
        (Draw(), "1e-5,,2e-5", 'got ""'),
        (Draw(), "1e-5:1e-3:99999999", "expected 1 to 10000000 members, got 99999999"),
        (Draw(members=3), "1e-5,1e-4", "--members: expected --jitter beside it on a grid"),
        (Draw("sobol"), "1e-5:1e-3", "--sample: expected --members N beside sobol"),
        (Draw("sobol", 8), "1e-5:1e-3:5", "expected LOW:HIGH[:log] with --sample sobol, got a count"),
        (Draw("random", 8), "1e-5,1e-4", "expected LOW:HIGH[:log] with --sample random, got a list"),
    ],
)
def test_a_range_without_members_is_refused(draw: Draw, text: str, pieces: str) -> None:
    with pytest.raises(BadInput) as refusal:
        members(draw, clearance=text)
    assert pieces in str(refusal.value)
