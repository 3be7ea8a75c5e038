"""Terms outside the catalogue: which balance, over which driver, and the simplest formula."""
