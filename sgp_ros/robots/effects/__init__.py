"""Physics that a nominal robot may lack, as data: one `Effect` for each kind."""
