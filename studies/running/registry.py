"""The studies by name, each imported only when asked for. A new study is a new file and a line here."""

STUDIES = {
    "agreement": "studies.agreement",
    "clearance": "studies.clearance",
    "work-precision": "studies.work_precision.study",
    "energy": "studies.energy",
    "predictability": "studies.predictability",
    "stability": "studies.stability",
    "extremes": "studies.extremes",
    "motions": "studies.motions",
}
#: Studies of one scene of the user's, which commands of their own run.
OF_ONE_SCENE = {"comparison": "studies.comparison.study", "sweep": "studies.sweeps.measure"}


def study_module(name: str) -> str:
    """Return the import path of a study's module; a study without a name here is named by that path."""
    return {**STUDIES, **OF_ONE_SCENE}.get(name, name)
