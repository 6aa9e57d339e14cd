"""The studies by name, each imported only when asked for."""

STUDIES = {
    name: f"studies.{name}"
    for name in ("accuracy", "energy", "predictability", "cost", "stability", "extremes")
}
#: Studies of one scene of the user's, which commands of their own run.
OF_ONE_SCENE = {"comparison": "studies.compare", "sweep": "studies.sweep"}


def study_module(name: str) -> str:
    """Return the import path of a study's module; a study without a name here is named by that path."""
    return {**STUDIES, **OF_ONE_SCENE}.get(name, name)
