"""The directive ``picture``: the figure that a Python expression returns, drawn when the pages are built.

```{picture} The pin in its clearance
cs.simulate("clearance-driven-0.5mm", end=0.003).plot_orbit("B")
```
"""

from html import escape
from io import StringIO

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import crankslider as cs


class Picture(SphinxDirective):
    """A figure with the argument below it."""

    has_content = True
    required_arguments, final_argument_whitespace = 1, True

    def run(self) -> list[nodes.Node]:
        """Return the figure as SVG within the page."""
        svg, caption = StringIO(), escape(self.arguments[0])
        eval("\n".join(self.content), {"cs": cs}).savefig(svg, format="svg", bbox_inches="tight")
        drawing = svg.getvalue()[svg.getvalue().index("<svg") :]
        figure = f'<figure role="img" aria-label="{caption}">{drawing}'
        return [nodes.raw("", f"{figure}<figcaption>{caption}</figcaption></figure>", format="html")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the directive to Sphinx."""
    app.add_directive("picture", Picture)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
