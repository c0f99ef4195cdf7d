"""The suite of bulk behaviour that only ensembles show: cooling, packing, repose."""
