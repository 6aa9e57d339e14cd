"""The accuracy suite, ``make accuracy``: every number that has a baseline is within its band."""

import pytest

from studies.conformance.baselines.measured import measured
from studies.conformance.baselines.subjects import subjects
from studies.conformance.baselines.table import read_tables
from studies.conformance.baselines.verdicts import verdicts

BASELINES = read_tables()
SUBJECTS = {subject.key: subject for subject in subjects()}
#: What runs here and what has baselines: neither may be without the other.
KEYS = sorted(SUBJECTS.keys() | {key[:3] for key in BASELINES})


@pytest.mark.accuracy
@pytest.mark.parametrize("key", KEYS, ids="-".join)
def test_every_number_is_within_its_band(key: tuple[str, str, str]) -> None:
    assert key in SUBJECTS, f"{key[2]} has baselines on {key[1]}, and does not run it: is it installed?"
    of_subject = {name: baseline for name, baseline in BASELINES.items() if name[:3] == key}
    lines = verdicts(measured(SUBJECTS[key]), of_subject)
    assert not lines, "\n".join(lines)
