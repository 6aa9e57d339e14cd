"""The page's chapters, one folder a study."""
