"""The chapter of the gallery of extremes."""
