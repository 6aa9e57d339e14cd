"""Scenes of the user's in a study, in place of the library's, and how rows of them are told from others."""

import hashlib
import re
from collections.abc import Sequence
from dataclasses import replace

from engine_models.scene.parts import AnyScene
from engine_models.scene.plain_words import BadInput, shown
from studies.running.case import Case, Study, Value

#: The column of what is in a scene of the user's: another one may have had its name.
CONTENT = "scene_content"


def cases_of(name: str, study: Study, full: bool, scenes: Sequence[AnyScene]) -> list[Case]:
    """Return a study's cases, on these scenes if there are any.

    Raises:
        BadInput: the study takes no scenes, or one is not of its kind.
    """
    if not scenes:
        return study.cases(full)
    on = getattr(study, "cases_on", None)
    if on is None:
        raise BadInput(f"--scene: expected nothing for the study {name}, whose scenes are its own")
    return [_told_apart(case, scene) for scene in scenes for case in on(scene, full)]


def require_names(scenes: Sequence[AnyScene]) -> None:
    """Raise BadInput unless every scene has a name of its own that can be a file's."""
    for place, scene in enumerate(scenes):
        if not re.fullmatch(r"\w[\w.+-]*", scene.name):
            expected = "a name of letters, digits, '.', '+', '-' and '_'"
            raise BadInput(f"--scene: expected {expected} in the file, got {shown(scene.name)}")
        if scene.name in [other.name for other in scenes[:place]]:
            raise BadInput(f"--scene: expected scenes with names of their own, got two {shown(scene.name)}")


def contents(cases: Sequence[Case]) -> dict[str, Value]:
    """Return what is in each scene of some cases, by its name: None of a study's own."""
    return {case.scene.name: case.columns.get(CONTENT) for case in cases}


def _told_apart(case: Case, scene: AnyScene) -> Case:
    content = hashlib.sha256(scene.model_dump_json().encode()).hexdigest()[:8]
    return replace(case, columns={**case.columns, CONTENT: content})
