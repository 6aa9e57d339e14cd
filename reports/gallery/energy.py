"""The energy ledger over one revolution as stacked areas: where it is, and what came in."""

from collections.abc import Mapping

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from reports.gallery.data import angle_deg, of_view
from reports.gallery.drawing import WIDTH_IN
from reports.gallery.over_time import TURN
from reports.parts import Figure
from reports.results import FloatArray, Results
from reports.style import BLACK, RC
from reports.tables import listed

#: The areas from below with face and hatch, which tells them apart in greyscale: all energy, and of it what
#: contacts have.
ALL = {
    "kinetic_energy_J": ("kinetic", "#9CC9E8", ""),
    "gravitational_change_J": ("height, above the lowest", "#F5D58A", "\\\\\\"),
}
IN_CONTACTS = {
    "dissipated_energy_J": ("dissipated in contacts", "#E79A76", "///"),
    "elastic_change_J": ("elastic in contacts", "#4E9A5B", ""),
}
#: Heights have no zero of their own.
FROM_LOWEST = ("gravitational_change_J",)
GIVEN, EDGE, EVERY = "there at the start, and work since", "#6A6A6A", 6


def energy_figure(results: Results) -> Figure | None:
    """Return a row of two panels for each scene with compliant contacts; None without."""
    rows = of_view(results, "revolution")
    rows = rows[rows["shortest_contact_s"] > 0].drop_duplicates("scene")
    if rows.empty:
        return None
    with mpl.rc_context(RC):
        drawing = Drawing(figsize=(WIDTH_IN, 1.85 * len(rows) + 0.8))
        panels = drawing.subplots(len(rows), 2, squeeze=False)
        for (whole, part), (_, row) in zip(panels, rows.iterrows(), strict=True):
            turn = angle_deg(results, row)[::EVERY]
            top = _stack(whole, results, row, ALL | IN_CONTACTS)
            work = [
                results.curve(row["case"], name) for name in row.dropna().index if name.endswith("_work_J")
            ]
            given = top[0] + sum(curve[::EVERY] for curve in work)
            whole.plot(turn, np.broadcast_to(given, turn.shape), color=BLACK, linewidth=1.3, label=GIVEN)
            _stack(part, results, row, IN_CONTACTS)
            whole.set_title(row["scene"], loc="left")
            part.set_title("contacts alone", loc="left")
            for ax in (whole, part):
                ax.set(xlabel=TURN, ylabel="energy [J]")
                ax.set_ylim(bottom=0)
        drawing.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return Figure(
        "motions-energy",
        "The energy ledger over one revolution",
        "Areas are stacked: what the bodies hold, and what contacts hold and have dissipated, alone on the "
        "right. The line is what was there at the start and the work of driver and loads since; it runs "
        f"along the top of the stack if nothing is made or lost. By {rows['label'].iloc[0]}.",
        f"{len(rows)} rows of stacked energies over the crank's angle: {listed(rows['scene'])}.",
        drawing,
    )


def _stack(
    ax: Axes, results: Results, row: pd.Series, areas: Mapping[str, tuple[str, str, str]]
) -> FloatArray:
    """Stack energies over the crank's turn, each counted from its lowest; return the top of the stack."""
    turn = angle_deg(results, row)[::EVERY]
    base = np.zeros(len(turn))
    for name, (label, face, hatch) in areas.items():
        curve = results.curve(row["case"], name)[::EVERY]
        top = base + (curve - curve.min() if name in FROM_LOWEST else curve)
        ax.fill_between(
            turn, base, top, label=label, facecolor=face, hatch=hatch, edgecolor=EDGE, linewidth=0.3
        )
        base = top
    return base
