"""The energy ledger over one revolution as stacked areas: where it is, and what came in."""

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure as Drawing

from reports.gallery.data import angle_deg, of_view
from reports.gallery.drawing import WIDTH_IN
from reports.gallery.over_time import TURN
from reports.parts import Figure
from reports.results import FloatArray, Results
from reports.style import BLACK, RC
from reports.tables import listed

#: The areas from below, each with its face and hatch; told apart in greyscale by the hatches.
AREAS = {
    "kinetic_energy_J": ("kinetic", "#9CC9E8", ""),
    "potential_energy_J": ("potential: height and contacts", "#F5D58A", "\\\\\\"),
    "dissipated_energy_J": ("dissipated in contacts", "#E79A76", "///"),
}
EVERY = 4


def energy_figure(results: Results) -> Figure | None:
    """Return a panel for each scene with compliant contacts; None without."""
    rows = of_view(results, "revolution")
    rows = rows[rows["shortest_contact_s"] > 0].drop_duplicates("scene")
    if rows.empty:
        return None
    with mpl.rc_context(RC):
        drawing = Drawing(figsize=(WIDTH_IN, 1.85 * len(rows) + 0.7))
        panels = drawing.subplots(len(rows), 1, squeeze=False)[:, 0]
        for ax, (_, row) in zip(panels, rows.iterrows(), strict=True):
            turn = angle_deg(results, row)[::EVERY]
            energies = {name: results.curve(row["case"], name)[::EVERY] for name in AREAS}
            energies["potential_energy_J"] -= energies["potential_energy_J"].min()
            given = sum(
                (results.curve(row["case"], name)[::EVERY] for name in row.dropna().index if name.endswith("_work_J")),
                start=np.zeros(len(turn)),
            )
            base = np.zeros(len(turn))
            for name, (label, face, hatch) in AREAS.items():
                top = base + energies[name]
                style = {"facecolor": face, "hatch": hatch, "edgecolor": "#6A6A6A", "linewidth": 0.3}
                ax.fill_between(turn, base, top, label=label, **style)
                base = top
            ax.plot(turn, _begun(energies) + given, color=BLACK, linewidth=1.3, label="at the start, and work since")
            ax.set(ylabel="energy [J]")
            ax.set_ylim(bottom=0)
            ax.set_title(f"{row['scene']}, {row['label']}", loc="left")
        panels[-1].set(xlabel=TURN)
        drawing.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return Figure(
        "motions-energy",
        "The energy ledger over one revolution",
        "Areas are stacked: what bodies and contacts hold, and on top what contacts have dissipated. The line is "
        "what was there at the start and the work of driver and loads since; it runs along the top of the stack "
        "if nothing is made or lost. Height counts from the lowest in the run.",
        f"{len(rows)} panels of stacked energies over the crank's angle: {listed(rows['scene'])}.",
        drawing,
    )


def _begun(energies: dict[str, FloatArray]) -> float:
    return float(sum(curve[0] for curve in energies.values()))

