"""Accuracy baselines: what the studies measure of every engine and arm, with the band that it keeps."""
