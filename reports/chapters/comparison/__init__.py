"""What a comparison on one scene says: a recommendation, and a page of its own with the figures behind it."""
