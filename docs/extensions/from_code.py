"""The directive ``from-code``: a page contains descriptions from the present code.

```{from-code} engine pymunk
```
"""

from collections.abc import Callable

from code_as_markdown import commands, engine, scene_sections, scenes
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

WRITERS: dict[str, Callable[..., str]] = {
    "commands": commands,
    "engine": engine,
    "scene-sections": scene_sections,
    "scenes": scenes,
}


class FromCode(SphinxDirective):
    """The text of the writer of this name, called with the arguments after it."""

    required_arguments, optional_arguments = 1, 1

    def run(self) -> list[nodes.Node]:
        """Return the parsed text."""
        writer, *arguments = self.arguments
        return self.parse_text_to_nodes(WRITERS[writer](*arguments), allow_section_headings=True)


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the directive to Sphinx."""
    app.add_directive("from-code", FromCode)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
