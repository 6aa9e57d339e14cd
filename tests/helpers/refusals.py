"""What a refusal of the command line looks like."""


def require_refusal(stdout: str, stderr: str, code: object, *pieces: str) -> None:
    """Require exit code 2, no output, and one line of error with these pieces in it."""
    assert code == 2, stderr
    assert stdout == ""
    assert stderr.startswith("error: ")
    assert stderr.count("\n") == 1
    assert stderr.endswith("\n")
    assert "Traceback" not in stderr
    assert "pydantic" not in stderr
    for piece in pieces:
        assert piece in stderr
