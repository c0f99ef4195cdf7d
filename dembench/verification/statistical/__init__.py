"""The suite of bulk behaviour that only ensembles show: cooling, packing, weight in silos."""
