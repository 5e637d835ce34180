"""Classical reconstruction of the runs' own clouds: screened Poisson, labels carried over. See docs/peers.md."""
