"""Looking after data sets on disk: their splits, what they hold, disturbed copies of them."""
