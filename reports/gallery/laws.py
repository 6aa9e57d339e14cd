"""The contact laws as one impact has them: force over penetration, there and back."""

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure as Drawing

from reports.gallery.data import of_view
from reports.gallery.drawing import WIDTH_IN
from reports.parts import Figure
from reports.results import Results
from reports.style import BLUE, GREY, RC, VERMILLION

UM, KN, ACROSS = 1e6, 1e-3, 4


def laws_figure(results: Results) -> Figure | None:
    """Return the loops of all laws in the same first impact, Hertz's line behind each; None without runs."""
    rows = of_view(results, "law")
    if rows.empty:
        return None
    names = list(rows.sort_values("dissipated_energy_J")["law"])
    with mpl.rc_context(RC):
        down = -(-len(names) // ACROSS)
        drawing = Drawing(figsize=(WIDTH_IN, 1.65 * down + 0.75))
        panels = drawing.subplots(down, ACROSS, sharex=True, sharey=True, squeeze=False).ravel()
        for ax, law in zip(panels, names, strict=False):
            ax.set_title(law, fontsize=7.5)
            for other in dict.fromkeys(("hertz", law)):
                case = rows.loc[rows["law"] == other, "case"].iloc[0]
                depth = results.curve(case, "contact_B_penetration_m") * UM
                force = results.curve(case, "contact_B_normal_force_N") * KN
                touching = np.flatnonzero(depth >= 0)
                deepest = int(depth.argmax())
                ways = {
                    "in": (touching[touching <= deepest], VERMILLION, "-"),
                    "out": (touching[touching >= deepest], BLUE, "--"),
                }
                for way, (places, colour, dashes) in ways.items():
                    style = {"color": colour, "linestyle": dashes} if other == law else {"color": GREY}
                    behind = law not in ("hertz", other)
                    label = f"pin going {way}" if other == law else ""
                    ax.plot(
                        depth[places],
                        force[places],
                        label=label,
                        linewidth=0.8 if behind else 1.4,
                        **style,
                    )
        for ax in panels[len(names) :]:
            ax.remove()
        drawing.supxlabel("penetration [µm]", fontsize=8.5)
        drawing.supylabel("contact force [kN]", fontsize=8.5)
        handles, labels = panels[0].get_legend_handles_labels()
        drawing.legend(handles, labels, loc="outside upper center", ncols=2)
    restitution = rows["restitution"].dropna().iloc[0]
    return Figure(
        "motions-laws",
        "Contact laws: force over penetration",
        f"The same first impact under every dissipative law at restitution {restitution:g}, and without "
        "loss by Hertz, which is the thin line behind the others. The area of a loop is the energy lost; "
        "laws are in its order. By the reference.",
        f"{len(names)} panels of force over penetration, loading and unloading: {', '.join(names)}.",
        drawing,
    )
