"""What results are held against: truths, converged solutions, and metrics of trajectories alone."""
