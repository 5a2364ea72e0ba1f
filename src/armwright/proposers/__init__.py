"""Proposers: where structural ideas come from, one design for every n_step trials."""
