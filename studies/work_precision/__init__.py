"""Error against run time: the ladders of every engine, the study that climbs them, the search behind them."""
