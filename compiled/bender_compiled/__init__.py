"""The plant's own step functions compiled over whole records, for fits that need thousands of simulations."""
