"""Where results come from: the code that was imported, whatever the files say by now."""

from pathlib import Path

import pytest

from studies.running import provenance


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A root with a package in a package, as if it had just been imported."""
    (tmp_path / "studies/part").mkdir(parents=True)
    (tmp_path / "studies/one.py").write_text("X = 1\n")
    (tmp_path / "studies/part/one.py").write_text("Y = 2\n")
    monkeypatch.setattr(provenance, "ROOT", tmp_path)
    imported(monkeypatch)
    return tmp_path


def imported(monkeypatch: pytest.MonkeyPatch) -> tuple[str, str]:
    """Take the files as imported now; return fingerprint and digest."""
    stamps = provenance._stamps()
    monkeypatch.setattr(provenance, "_STAMPS", stamps)
    sources = {path: (provenance.ROOT / path).read_bytes() for path in stamps}
    monkeypatch.setattr(provenance, "_SOURCES", sources)
    return provenance.fingerprint.__wrapped__(), provenance.code_digest()


def test_a_fingerprint_is_of_what_was_imported(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = provenance.fingerprint.__wrapped__(), provenance.code_digest()
    (root / "studies/part/one.py").write_text("Y = 3\n")
    assert (provenance.fingerprint.__wrapped__(), provenance.code_digest()) == before
    assert not set(imported(monkeypatch)) & set(before)


def test_a_comment_changes_the_digest_alone(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fingerprint, digest = imported(monkeypatch)
    (root / "studies/one.py").write_text("X  =  1  # why\n")
    assert provenance.changed_code() == []
    new, other = imported(monkeypatch)
    assert (new == fingerprint, other == digest) == (True, False)


def test_where_a_file_lies_counts(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = imported(monkeypatch)
    (root / "studies/part/one.py").rename(root / "studies/part/two.py")
    assert not set(imported(monkeypatch)) & set(before)


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("studies/part/one.py", "Y = 3\n"),
        ("studies/part/one.py", "Y = (\n"),
        ("studies/part/one.py", None),
        ("studies/part/new.py", "Z = 1\n"),
    ],
)
def test_what_changed_is_named(root: Path, path: str, text: str | None) -> None:
    assert provenance.changed_code() == []
    if text is None:
        (root / path).unlink()
    else:
        (root / path).write_text(text)
    assert provenance.changed_code() == [path]
