"""What a sweep has kept is not trusted: a part, or the file, that is not as it was written is made again."""

import shutil
from collections.abc import Callable
from pathlib import Path
from random import Random

import pandas as pd
import pyarrow as pa
import pytest
from pyarrow import parquet

from engine_models.scene.library import SCENES
from studies.command.sweep import asked, options_of
from studies.predictability.sweeps.run import run_sweep
from studies.running.failures import BadInput
from tests.helpers.running import Here

#: Sixteen chunks, of which twelve are there when a sweep is interrupted.
FIELD, MEMBERS, DONE = "clearance.B.radial_clearance_m", 30, 12
NAME, PARTS = "rows.parquet", "rows.parquet.parts"
#: What may be done to a file, and to the table in one.
KINDS = (
    "cut",
    "emptied",
    "bits flipped",
    "lines left out",
    "noise",
    "more behind it",
    "gone",
    "there twice",
    "another in its place",
    "under another name",
    "under another's name",
)
OF_TABLES = ("fewer rows", "rows twice", "rows mixed up", "a column less", "another type", "another number")


def harm(some: Random, kind: str, file: Path, other: Path) -> None:
    """Do something to a file, which may take the place or the name of an ``other`` one like it."""
    content = file.read_bytes()
    if kind in OF_TABLES:
        table = parquet.read_table(file)
        parquet.write_table(_changed(some, kind, table).replace_schema_metadata(table.schema.metadata), file)
        return
    match kind:
        case "cut":
            file.write_bytes(content[: some.randrange(len(content) + 1)])
        case "emptied":
            file.write_bytes(b"")
        case "bits flipped":
            flipped = bytearray(content)
            for _ in range(some.choice([1, 1, 8, 64]) if content else 0):
                flipped[some.randrange(len(content))] ^= 1 << some.randrange(8)
            file.write_bytes(flipped)
        case "lines left out":
            lines = content.splitlines(keepends=True)
            file.write_bytes(b"".join(line for line in lines if some.random() < 0.7))
        case "noise":
            file.write_bytes(some.randbytes(300))
        case "more behind it":
            file.write_bytes(content + b"{}\n")
        case "another in its place":
            file.write_bytes(other.read_bytes())
        case "under another name":
            file.rename(file.with_name(f"0{file.name}"))
        case "under another's name":
            file.rename(file.with_name(other.name))
        case "there twice":
            shutil.copy(file, file.with_name(f"9{file.name}"))
        case "gone":
            file.unlink()
        case _:
            raise AssertionError(kind)


def _changed(some: Random, kind: str, table: pa.Table) -> pa.Table:
    names, count = table.schema.names, len(table)
    match kind:
        case "fewer rows":
            return table.slice(0, some.randrange(count))
        case "rows twice":
            return pa.concat_tables([table, table])
        case "rows mixed up":
            return table.take(some.sample(range(count), count))
        case "a column less":
            return table.drop([some.choice(names)])
        case "another type":
            place, column = names.index("member"), table["member"].cast(pa.int32())
        case _:
            place = some.choice([n for n in range(len(names)) if table.schema.field(n).type == pa.float64()])
            numbers = table[place].to_pylist()
            numbers[some.randrange(count)] = some.choice([0.0, 1e300, -1.5])
            column = pa.array(numbers, pa.float64())
    return table.set_column(place, names[place], column)


def swept(
    folder: Path,
    first: Callable[[int], None] = lambda _: None,
    members: int = MEMBERS,
    chain: str | None = None,
) -> pd.DataFrame:
    folder.mkdir(exist_ok=True)
    field = "start.crank_speed_rad_s" if chain else FIELD
    values = f"300:400:{members}" if chain else f"1e-5:1e-3:log:{members}"
    options = options_of({"revolutions": "1" if chain else "0.1", "chain": chain})
    sweep = asked(SCENES["clearance-driven-0.5mm"](), {field: values}, "reference", {}, False, options)
    run_sweep(sweep, folder / NAME, {}, 2, lambda: Here(first), 1.0)
    return pd.read_parquet(folder / NAME)


def interrupted(folder: Path, calls: int = DONE) -> Path:
    """Return the parts of a sweep that was interrupted."""

    def interrupt(call: int) -> None:
        if call == calls + 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        swept(folder, interrupt)
    return folder / PARTS


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    swept(folder := tmp_path_factory.mktemp("whole"))
    return folder


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return interrupted(tmp_path_factory.mktemp("parts"))


@pytest.mark.parametrize("kind", [*KINDS, *OF_TABLES])
def test_a_part_that_is_not_as_it_was_written_is_made_again_and_said(
    kind: str, whole: Path, parts: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = Path(shutil.copytree(parts, tmp_path / PARTS))
    files = sorted(copy.glob("*.parquet"))
    assert len(files) == DONE
    harm(Random(1), kind, files[2], files[3])
    found = swept(tmp_path)
    pd.testing.assert_frame_equal(found, pd.read_parquet(whole / NAME), check_exact=True)
    assert ("parts are not as they were written: they are made again" in capsys.readouterr().err) == (
        kind != "gone"
    )
    assert [file.name for file in tmp_path.iterdir()] == [NAME]


@pytest.mark.parametrize(
    "kind", [kind for kind in (*KINDS, *OF_TABLES) if "another" not in kind or kind in OF_TABLES]
)
def test_a_file_that_is_not_as_it_was_written_is_made_again_and_said(
    kind: str, whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = Path(shutil.copy(whole / NAME, tmp_path))
    right = pd.read_parquet(file)
    harm(Random(1), kind, file, file)
    pd.testing.assert_frame_equal(swept(tmp_path), right, check_exact=True)
    said = capsys.readouterr().err
    assert ("has not all 30 members as this sweep wrote them" in said) == (
        kind not in ("gone", "there twice")
    )
    assert ("has all 30 members already" in said) == (kind == "there twice")


def test_the_file_of_another_sweep_is_not_taken_for_this_one(whole: Path, tmp_path: Path) -> None:
    shutil.copy(whole / NAME, tmp_path)
    assert len(swept(tmp_path, members=MEMBERS - 1)) == MEMBERS - 1


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"sweep": 3', b"\xff", b'"sweep"'])
def test_parts_tell_whose_they_are_where_the_note_of_it_is_damaged(
    content: bytes, whole: Path, parts: Path, tmp_path: Path
) -> None:
    copy = Path(shutil.copytree(parts, tmp_path / PARTS))
    (copy / "sweep.json").write_bytes(content)
    calls: list[int] = []
    pd.testing.assert_frame_equal(
        swept(tmp_path, calls.append), pd.read_parquet(whole / NAME), check_exact=True
    )
    assert 0 < len(calls) <= MEMBERS - DONE
    others = tmp_path / "others"
    others.mkdir()
    shutil.copytree(parts, others / PARTS)
    (others / PARTS / "sweep.json").write_bytes(content)
    with pytest.raises(BadInput, match="--out: expected a file without parts of another sweep"):
        swept(others, members=MEMBERS - 1)
    assert len(list((others / PARTS).glob("*.parquet"))) == DONE, "nothing of another's is lost"


def test_a_chain_goes_on_behind_the_parts_between_its_gaps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its second and its fourth chunk are gone: each begins where the one before it ended."""
    monkeypatch.setattr("studies.predictability.sweeps.run.MOST_IN_CHUNK", 2)

    def interrupt(call: int) -> None:
        if call == 6:
            raise KeyboardInterrupt

    right = swept(tmp_path / "right", members=12, chain="up")
    with pytest.raises(KeyboardInterrupt):
        swept(tmp_path / "gaps", interrupt, members=12, chain="up")
    files = sorted((tmp_path / "gaps" / PARTS).glob("*.parquet"))
    for file in (files[1], files[3]):
        file.write_bytes(b"")
    again: list[int] = []
    pd.testing.assert_frame_equal(swept(tmp_path / "gaps", again.append, 12, "up"), right, check_exact=True)
    assert len(again) == 3
