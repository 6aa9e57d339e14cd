"""A film that runs engines side by side: their positions as numbers, drawn by the page itself."""

import json

import numpy as np
import pandas as pd

from reports.gallery.data import of_view
from reports.gallery.markup import rendered
from reports.gallery.orbits import radius_m
from reports.results import FloatArray, Results
from reports.run.mechanism import Mechanism, places
from reports.style import GREY, line_styles

#: The scene that is shown, the joint of its clearance, and how many times as large that is drawn.
SCENE, JOINT, EXAGGERATION = "clearance-driven-0.5mm", "B", 20.0
#: Pictures of a film and how long each is shown, in ms; digits of lengths in mm.
PICTURES, EACH_MS, DIGITS = 240, 50, 2
MM = 1e3
COLUMNS = ("crank_angle_rad", "slider_position_m", f"clearance_{JOINT}_x_m", f"clearance_{JOINT}_y_m")


def film_html(results: Results) -> str:
    """Return the film with play, pause and a slider, truth first; empty without runs of its scene."""
    rows = of_view(results, "revolution")
    rows = rows[rows["scene"] == SCENE]
    whole = of_view(results, "whole").set_index("scene")
    if rows.empty or SCENE not in whole.index:
        return ""
    scene, styles = json.loads(whole.loc[SCENE, "scene_json"]), line_styles(rows)
    first = rows["case"].iloc[0]
    mechanism = Mechanism(
        scene["crank"]["length_m"], scene["rod"]["length_m"], {JOINT: radius_m(results, first, JOINT)}
    )
    times = np.linspace(0, results.curve(first, "time_s")[-1], PICTURES)
    shown = {"truth": (GREY, _frame(results, first, times, "true_"))}
    shown |= {
        row["label"]: (styles[row["label"]]["color"], _frame(results, row["case"], times))
        for _, row in rows.iterrows()
    }
    views = [
        {"label": label, "colour": colour, "pictures": _pictures(frame, mechanism)}
        for label, (colour, frame) in shown.items()
    ]
    return rendered(
        "film.html.jinja",
        scene=SCENE,
        joint=JOINT,
        exaggeration=EXAGGERATION,
        each_ms=EACH_MS,
        last=PICTURES - 1,
        film={
            "crank_mm": MM * mechanism.crank_m,
            "rod_mm": MM * scene["rod"]["length_m"],
            "clearance_mm": round(MM * EXAGGERATION * mechanism.radial_clearance_m[JOINT], DIGITS),
            "times_ms": [round(float(time) * 1e3, 3) for time in times],
            "views": views,
        },
    )


def _frame(results: Results, case: str, times: FloatArray, prefix: str = "") -> pd.DataFrame:
    """Return a run's columns, or its truth's, at other times than its samples."""
    own = results.curve(case, "time_s")
    return pd.DataFrame(
        {name: np.interp(times, own, results.curve(case, f"{prefix}{name}")) for name in COLUMNS}
    )


def _pictures(frame: pd.DataFrame, mechanism: Mechanism) -> list[list[float]]:
    """Return in mm for each picture: x and y of the crank's end, of the rod's, x of the slider, the gap."""
    at = places(frame, mechanism, EXAGGERATION)
    gap = at.pin[JOINT] - at.bearing[JOINT]
    numbers = np.hstack([at.crank_end, at.bearing[JOINT], at.pin[JOINT][:, :1], gap])
    pictures: list[list[float]] = (MM * numbers).round(DIGITS).tolist()
    return pictures
