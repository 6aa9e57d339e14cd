"""What a comparison on one scene shows: a recommendation in sentences, and a page with its figures."""
