"""What is computed from rows: orders, run times at equal error, verdicts, statistics."""
