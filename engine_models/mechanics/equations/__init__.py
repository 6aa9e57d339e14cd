"""A scene's equations of motion for whoever integrates them: by multipliers, and in minimal coordinates."""
