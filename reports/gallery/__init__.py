"""The gallery on the page: the mechanism, its motion over one revolution, an impact, orbits, energy.

As a chapter it is like those of the studies, but for the equations and the film, which are markup.
"""

import json
from collections.abc import Iterator
from dataclasses import replace

from reports import shared_tables
from reports.gallery import over_time
from reports.gallery.cards import scene_cards
from reports.gallery.data import joints_with_clearance, of_view
from reports.gallery.drawing import mechanism_figure
from reports.gallery.energy import energy_figure
from reports.gallery.film import film_html
from reports.gallery.impact import impact_figures
from reports.gallery.laws import laws_figure
from reports.gallery.markup import equations_html
from reports.gallery.orbits import orbit_figures
from reports.parts import Section
from reports.results import Results
from reports.tables import plain

STUDY = "motions"
TITLE = "Pictures of the motion"
INTRODUCTION = (
    "What the mechanism does, and what each engine makes of it: over one revolution, or up to the time to "
    "which the motion is known where that is shorter, and over one impact from near. Every engine is at the "
    "middle of its ladder of settings, as a user would take it who asks for nothing special."
)
#: The scene whose numbers are in the drawing.
DRAWN = "clearance-driven-0.5mm"


def sections(results: Results) -> list[Section]:
    """Return the sections of the gallery; without curves the mechanism is all there is to be seen."""
    told = [
        Section.of(
            "runs",
            "Engines and settings",
            (),
            tables=[shared_tables.settings_table(results.rows, STUDY)],
        ),
        shared_tables.failures_section(results.rows, STUDY, "motions-failures"),
    ]
    return [_mechanism(results), *(_over_time(results) if results.has_curves else ()), *told]


def _mechanism(results: Results) -> Section:
    whole = of_view(results, "whole").set_index("scene")
    drawn = [mechanism_figure(json.loads(whole.loc[DRAWN, "scene_json"]))] if DRAWN in whole.index else []
    laws = [laws_figure(results)] if results.has_curves else []
    section = Section.of("mechanism", "The mechanism and its contacts", (), [*drawn, *laws])
    return replace(section, markup=equations_html())


def _over_time(results: Results) -> list[Section]:
    runs = of_view(results, "revolution")
    ideal = runs[runs["contacts_ended"].isna()]
    signals = (over_time.POSITION, over_time.VELOCITY, over_time.JOINT, over_time.TORQUE)
    return [
        Section.of("scenes", "The scenes", (), [card.as_figure() for card in scene_cards(results)]),
        Section.of(
            "ideal",
            "One revolution with ideal joints",
            (),
            [figure for signal in signals for figure in over_time.signal_figures(results, ideal, signal)],
        ),
        Section.of(
            "clearance",
            "One revolution with clearance",
            forces_found(results),
            [
                *over_time.signal_figures(results, runs.drop(ideal.index), over_time.DEVIATION),
                *over_time.contact_force_figures(results),
            ],
        ),
        Section("film", "The engines side by side", (), markup=film_html(results)),
        Section.of("impact", "One impact", (), impact_figures(results)),
        Section.of("orbits", "The pin in its bearing", (), orbit_figures(results)),
        Section.of("energy", "Where the energy is", (), [energy_figure(results)]),
    ]


def forces_found(results: Results) -> Iterator[str]:
    """Yield for each scene with compliant contacts the largest contact force, and who misses it by most."""
    runs = of_view(results, "revolution")
    for scene, rows in runs[runs["shortest_contact_s"] > 0].groupby("scene"):
        for joint in joints_with_clearance(rows.iloc[0]):
            column = f"contact_{joint}_normal_force_error_N"
            worst = rows.loc[rows[column].idxmax()]
            largest = results.curve(rows.iloc[0]["case"], f"true_contact_{joint}_normal_force_N").max()
            yield (
                f"On {scene} the pin of joint {joint} is pressed with up to {plain(largest / 1e3)} kN; "
                f"{worst['label']} is the furthest from the truth's force at the same time, by "
                f"{plain(worst[column])} N."
            )
