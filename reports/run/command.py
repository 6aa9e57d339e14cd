"""The command that makes the run of a row again."""

import pandas as pd


def command(row: pd.Series, scene: str) -> str:
    """Return the command that makes a row's run, with all settings that the row has.

    ``scene`` is what is typed after ``crankslider simulate``: a library scene's name or a file, with options.
    """
    settings = row.filter(regex="^setting_").dropna()
    words = [f"--set {name.removeprefix('setting_')}={value}" for name, value in settings.items()]
    step = f"--step {row['step_s']:.6g}"
    return " ".join(["crankslider simulate", scene, f"--engine {row['engine']}", *words, step])
